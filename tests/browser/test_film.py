"""Films, and pictures for one: drawn by a real browser, picture by picture."""

import shutil

import numpy as np
import pytest
from PIL import Image

from cinegen.cockpit import film
from cinegen.cockpit.film import FPS, FilmError
from cinegen.session import arrange

SIZE = (320, 180)


def test_frames_show_the_robot_as_it_moves(robot, tmp_path):
    setup = arrange({"arm": robot("planar_3r")}, follow="line")
    progress = []
    assert film(setup, tmp_path / "frames", 0.2, SIZE, progress=progress.append) == tmp_path / "frames"
    pictures = sorted((tmp_path / "frames").iterdir())
    assert len(pictures) == round(0.2 * FPS)
    drawn = [np.asarray(Image.open(picture).convert("RGB")).astype(int) for picture in pictures]
    assert all(picture.shape == (SIZE[1], SIZE[0], 3) for picture in drawn)
    assert np.mean(drawn[0].max(axis=2) - drawn[0].min(axis=2) > 60) > 0.002  # a robot in colours
    assert np.abs(drawn[-1] - drawn[0]).max() > 60  # that has moved
    assert progress[-1] == pytest.approx(1.0)
    assert progress == sorted(progress)


def test_a_robot_at_rest_is_filmed(robot, tmp_path):
    """Though pages are sent nothing while nothing moves."""
    setup = arrange({"arm": robot("planar_3r")}, follow=None)
    film(setup, tmp_path / "frames", 0.2, SIZE)
    pictures = [picture.read_bytes() for picture in sorted((tmp_path / "frames").iterdir())]
    assert len(pictures) == round(0.2 * FPS)
    assert len(set(pictures)) == 1


def test_what_is_missing_is_told(robot, tmp_path, monkeypatch):
    setup = arrange({"arm": robot("planar_3r")})
    with pytest.raises(FilmError, match=r"film\.xyz"):
        film(setup, tmp_path / "film.xyz", 0.05, SIZE)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setattr("imageio_ffmpeg.get_ffmpeg_exe", lambda: (_ for _ in ()).throw(RuntimeError("none")))
    with pytest.raises(FilmError, match=r'install "cinegen\[film\]"'):
        film(setup, tmp_path / "film.mp4", 0.05, SIZE)
