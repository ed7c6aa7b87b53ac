"""Which graphic files the author of a robot's file may have read, and how the user allows others."""

from collections.abc import Callable
from pathlib import Path

import pytest

from raff2urdf.errors import RaffError
from raff2urdf.graphics.names import Packages, find, home_of, may_read

Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Write:
    """A function that writes files below a folder for work in the user's home, and returns the last one's folder."""
    (tmp_path / "home/work").mkdir(parents=True)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    for variable in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH", "RAFF2URDF_MESH_PATH"):
        monkeypatch.delenv(variable, raising=False)

    def write(*names: str, below: str = "home/work") -> Path:
        for name in names:
            path = tmp_path / below / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(name)
        return path.parent

    return write


@pytest.mark.parametrize(("robot", "mesh", "name"), [
    ("arm/arm.urdf", "arm/parts/a.stl", "parts/a.stl"),
    ("arm/urdf/arm.urdf", "arm/meshes/a.stl", "../meshes/a.stl"),
    ("arm/urdf/arm.urdf", "arm/meshes/a.stl", "package:///../meshes/a.stl"),
    ("arm/urdf/arm.urdf", "arm/meshes/a.stl", "package://arm/meshes/a.stl"),
    ("arm/robots/six/urdf/arm.urdf", "arm/meshes/a.stl", "model://arm/meshes/a.stl"),
    ("arm/arm.urdf", "arm/parts/meshes/a.stl", "package://parts/meshes/a.stl"),
])  # fmt: skip
def test_a_mesh_near_its_robot_is_found(write: Write, robot: str, mesh: str, name: str) -> None:
    assert find(name, write(mesh, robot)).read_text() == mesh


@pytest.mark.parametrize("mark", ["package.xml", "model.config"])
def test_all_of_a_package_and_of_those_beside_it_is_found(write: Write, mark: str) -> None:
    mesh = write(f"parts/{mark}", "parts/meshes/a.stl") / "a.stl"
    folder = write(f"arm/{mark}", "arm/meshes/b.stl", "arm/robots/one/two/three/four/arm.urdf")
    assert find("package://parts/meshes/a.stl", folder) == mesh
    assert find("../../../../../meshes/b.stl", folder) == find("package://arm/meshes/b.stl", folder)


@pytest.mark.parametrize(("files", "robot"), [
    (["arm-main/package.xml", "arm-main/meshes/a.stl"], "arm-main/urdf/arm.urdf"),  # a clone under another name
    (["ws/r/.git/x", "ws/r/p/package.xml", "ws/r/parts/package.xml", "ws/r/parts/meshes/a.stl"], "ws/r/p/arm.urdf"),
    (["ws/r/.git/x", "ws/r/p/package.xml", "ws/q/p/package.xml", "ws/q/p/meshes/a.stl"], "ws/r/p/arm.urdf"),
    (["ws/q/p/package.xml", "ws/q/p/meshes/a.stl"], "ws/r/p/urdf/arm.urdf"),  # without a repository
])  # fmt: skip
def test_a_package_has_the_name_in_its_package_xml_and_is_in_or_next_to_the_repository(write, files, robot) -> None:
    folder = write(*files, robot)
    mesh = next(name for name in files if name.endswith(".stl"))
    top = folder.parents[robot.count("/") - 1]
    (top / mesh).parents[1].joinpath("package.xml").write_text("<package><name> parts_of_arm </name></package>")
    assert find("package://parts_of_arm/meshes/a.stl", folder) == top / mesh
    assert Packages().find("parts_of_arm", folder) == (top / mesh).parents[1]
    with pytest.raises(RaffError, match="leads out of"):
        find("package://parts_of_arm/../../secret/a.stl", folder)


def test_packages_are_searched_within_bounds(write: Write) -> None:
    """Not in any depth below the repository, not where a name is hidden, and not below the home folder."""
    stated = "<package><name>parts</name></package>"
    of_robots = [("home/ws/a", "r/1/2/3/4/p", "r/arm"), ("home/ws/b", ".hidden/p", "r/arm"), ("home", "other/p", ".")]
    for below, name, robot in of_robots:
        write(f"{name}/a.stl", f"{name}/package.xml", "r/.git/x", below=below)
        folder = write(f"{robot}/arm.urdf", below=below)
        top = next(above for above in (folder, *folder.parents) if (above / name).is_dir())
        (top / name / "package.xml").write_text(stated)
        with pytest.raises(RaffError, match="the package 'parts' is not found"):
            find("package://parts/a.stl", folder)


def test_a_package_is_searched_first_where_the_user_says(write: Write) -> None:
    folder = write("arm/meshes/a.stl", "arm/package.xml", "arm/urdf/arm.urdf")
    package = write("meshes/a.stl", below="elsewhere/arm_of_today").parent
    packages = Packages({"arm": package})
    assert find("package://arm/meshes/a.stl", folder, packages=packages) == package / "meshes/a.stl"
    with pytest.raises(RaffError, match="there is no file"):
        find("package://arm/meshes/b.stl", folder, packages=packages)
    with pytest.raises(RaffError, match="leads out of"):
        find("package://arm/../secret.stl", folder, packages=packages)


@pytest.mark.parametrize(("below", "robot", "mesh", "name"), [
    ("home", "arm.urdf", "../other/a.stl", "../other/a.stl"),
    ("home/work", "arm/arm.urdf", "../secret/a.stl", "../../secret/a.stl"),
    ("home/work", "arm/arm.urdf", "secret/a.stl", "package://home/work/secret/a.stl"),
    ("home/work", "arm/arm.urdf", "../secret/a.stl", "package://secret/a.stl"),
    ("home/work", "a/b/c/d/arm.urdf", "secret/a.stl", "package://work/secret/a.stl"),
    ("home/work", "arm/arm.urdf", "../secret/a.stl", "package://arm/../../secret/a.stl"),
    ("home/work", "arm/arm.urdf", "../secret/a.stl", "package://../secret/a.stl"),
])  # fmt: skip
def test_what_is_elsewhere_is_refused(write: Write, below: str, robot: str, mesh: str, name: str) -> None:
    write(mesh, below=below)
    with pytest.raises(RaffError, match=r"leads out of|is not found: (name its folder|it is no name)"):
        find(name, write(robot, below=below))


@pytest.mark.parametrize("mark", ["", "package.xml"])
def test_a_folder_for_temporary_files_is_no_package(write: Write, tmp_path: Path, mark: str) -> None:
    """As /tmp is, where everybody may write: neither by its name, nor by a mark, nor as the folder above."""
    write("secret/a.stl", *([mark] if mark else []), below="scratch")
    (tmp_path / "scratch").chmod(0o1777)
    folder = write("arm/arm.urdf", below="scratch")
    assert home_of(folder) == folder
    for name in ("package://scratch/secret/a.stl", "../secret/a.stl"):
        with pytest.raises(RaffError, match=r"leads out of|the package 'scratch' is not found"):
            find(name, folder)


def test_the_root_is_no_package() -> None:
    assert home_of(Path("/robot")) == Path("/robot")
    with pytest.raises(RaffError, match="the package 'etc' is not found"):
        find("package://etc/passwd", Path("/robot"))


@pytest.mark.parametrize("form", ["{0}", "file://{0}", "../../../elsewhere/part 1.stl", "link.stl"])
def test_the_folder_that_an_error_names_can_be_allowed(write: Write, monkeypatch, form: str) -> None:
    mesh = write("part 1.stl", below="elsewhere") / "part 1.stl"
    folder = write("arm/arm.urdf")
    (folder / "link.stl").symlink_to(mesh)
    name = form.format(mesh)
    with pytest.raises(RaffError, match=r"leads out of .*RAFF2URDF_MESH_PATH=") as refused:
        find(name, folder)
    monkeypatch.setenv("RAFF2URDF_MESH_PATH", f"/nowhere:{str(refused.value).rpartition('=')[2]}")
    assert find(name, folder).samefile(mesh)
    assert may_read(mesh, folder)


def test_packages_of_the_environment_may_be_made_of_links(write: Write, tmp_path: Path, monkeypatch) -> None:
    """`colcon build --symlink-install` installs links to the files of the source folder."""
    source = write("a.stl", below="src/arm/meshes") / "a.stl"
    folder = write("package.xml", "urdf/arm.urdf", below="install/share/arm")
    (tmp_path / "install/share/arm/meshes").mkdir()
    (tmp_path / "install/share/arm/meshes/a.stl").symlink_to(source)
    with pytest.raises(RaffError, match="leads out of"):
        find("package://arm/meshes/a.stl", folder)
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "install"))
    assert find("package://arm/meshes/a.stl", folder).samefile(source)
    with pytest.raises(RaffError, match="leads out of"):
        find("package://arm/../../../src/arm/meshes/a.stl", folder)


def test_a_name_that_no_file_can_have_is_not_found(write: Write) -> None:
    folder = write("arm/arm.urdf")
    for name in ("file://a%00b.stl", 300 * "x" + ".stl"):
        with pytest.raises(RaffError, match="is not found"):
            find(name, folder)
