"""A person edits the file of a robot in an editor while the page is open."""

import os

import pytest
from axe import AXE, violations
from tabs import becomes, find, picture

import cinegen
from cinegen.cockpit import SetupFiles
from cinegen.session import arrange

ARM = """RAFF t
robot arm {
  link 1 { type 2 pred 0 parameters { theta 20 } limits { -170 170 } }
  link 2 { type 2 pred 1 parameters { d 300 theta 30 } limits { -120 120 } }
  link 3 { type 2 pred 2 parameters { d 250 theta 40 } limits { -150 150 } }
  frame 4 { pred 3 name "tip" parameters { d 200 } }
}
"""


def drawn(node):
    """JavaScript: whether meshes of a node are in the scene."""
    return f"cockpit.view.group('arm', '{node}').children.some((one) => one.children.length || one.isMesh)"


def test_each_save_is_seen_and_errors_stand_over_the_scene(tmp_path, text_file, opened):
    path = text_file("arm.raff", ARM)
    setup, files = SetupFiles.of(lambda: arrange({"arm": cinegen.load(path)}))
    _, page = opened(setup=setup, files=files)
    before = page.evaluate("cockpit.view.pose('arm', 'tip').position.toArray()")
    length, camera = page.evaluate("[cockpit.hello.robots[0].length, cockpit.view.cameraNumbers()]")
    rows = page.locator("#section-sensors .body > *")
    count = rows.count()
    page.evaluate("cockpit.select('arm', 'tip')")
    page.click("#pin")
    assert becomes(page, "cockpit.state.tasks.length === 1")
    picture(page, "file_before")
    (tmp_path / "arm.new").write_text(ARM.replace("d 300", "d 420"))
    os.replace(tmp_path / "arm.new", path)  # as vim saves
    assert becomes(page, f"cockpit.hello.robots[0].length > {length} && cockpit.report")
    assert becomes(page, f"{drawn('tip')} && {drawn('link3')}")
    assert rows.count() == count > 0
    assert page.evaluate("cockpit.state.tasks.map((task) => task.node)") == ["tip"]
    # the pin holds it
    assert becomes(page, f"Math.abs(cockpit.view.pose('arm', 'tip').position.x - {before[0]}) < 1e-3")
    assert page.evaluate("cockpit.view.cameraNumbers()") == pytest.approx(camera, abs=1e-6)
    path.write_text(ARM.replace("d 250", "d 2S0").replace("type 2 pred 2", "type 2 pred 9"))
    assert becomes(page, "!document.getElementById('file-problem').hidden")
    text = page.inner_text("#file-problem")
    assert "arm.raff:5:41: 'd' needs a number, and '2S0' is not one" in text
    picture(page, "file_errors")
    x, y, *_ = find(page, "arm", "link2")  # the last good robot is driven on
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 30, y - 20, steps=4)
    assert becomes(page, "cockpit.state.tasks.some((task) => task.source === 'pointer')")
    page.mouse.up()
    if AXE.is_file():
        for scheme in ("light", "dark"):
            page.emulate_media(color_scheme=scheme)
            assert violations(page, "#file-problem") == []
    path.write_text(ARM.replace("d 300", "d 420"))  # the same as before the errors
    assert becomes(page, "document.getElementById('file-problem').hidden")
    picture(page, "file_after")
