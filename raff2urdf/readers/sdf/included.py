"""Replace what an SDF includes by the models themselves, as sdformat does.

A model is searched as graphics are (`raff2urdf.graphics.names`), and only what may be read of these is read of it:

    model://gripper, package://robots/gripper    a folder with model.config, which names its SDF; or with model.sdf
    gripper, ../gripper/model.sdf                relative to the file that includes it

Elements remember their file for errors, and meshes are named as the file that includes them all would name them.
"""

from __future__ import annotations

import copy
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from lxml import etree

from raff2urdf.errors import RaffError, did_you_mean
from raff2urdf.graphics.names import MissingFileError
from raff2urdf.readers.sdf.model import TWO_AXES
from raff2urdf.readers.sdf.poses import MERGED
from raff2urdf.readers.urdf import numbers
from raff2urdf.readers.xml_file import FILE, error_at, parse_xml, read_text

_ENDINGS = (".sdf", ".world", ".xml", ".urdf")
_TRUE = ("1", "true")
_MOST = 20  # files that include each other


class _Place(NamedTuple):
    """A file that includes models.

    Attributes:
        path: of the file.
        root: folder to which the names of its meshes are relative.
        prefix: what these names begin with.
        trail: the files that include each other, from the outermost one on.
        find: the search for files, see `raff2urdf.graphics.names.find`.
    """

    path: Path
    root: Path
    prefix: str
    trail: tuple[Path, ...]
    find: Callable[[str, Path], Path]

    def name_of(self, file: str) -> str:
        """Return the name of a mesh, which the file names, for the outermost file."""
        if "://" in file or os.path.isabs(file):
            return file
        return self.prefix + Path(os.path.relpath(self.path.parent / file, self.root)).as_posix()


def robot_of(root: Any, name: str, robot: str | None, find: Callable[[str, Path], Path]) -> Any:
    """Return the element of a model, with everything that it includes.

    Args:
        root: of the SDF; changed.
        name: of the file, in errors.
        robot: which model; if None, the first that has joints, those that the file includes after its own; or else the
            first.
        find: the search for files, see `raff2urdf.graphics.names.find`.

    Raises:
        RaffError: there is no such model, or what it includes can't be read.
    """
    path = Path(name)
    place = _Place(path, path.parent, "", (path.absolute(),), find)
    _prepare(root)
    within = ("sdf", "world", "population")
    models = [model for model in root.iter("model") if model.getparent().tag in within]
    known, refused = [str(model.get("name")) for model in models], list[RaffError]()
    if robot is None:
        fitting = [model for model in models if next(model.iter("joint", "include"), None) is not None]
    else:
        fitting = [model for model in models if model.get("name") == robot]
    for include in [] if fitting else [e for e in root.iter("include") if e.getparent().tag in within]:
        stated = include.findtext("name", "").strip()
        if robot is not None and stated not in ("", robot):
            known.append(stated)
            continue
        try:
            model = _placed(include, place)
        except RaffError as error:
            refused.append(error)
            continue
        models.append(model)
        known.append(str(model.get("name")))
        if model.get("name") == robot or (robot is None and next(model.iter("joint"), None) is not None):
            fitting.append(model)
            break
    if robot is None:
        fitting += models
    if fitting:
        _expand(fitting[0], place)
        return fitting[0]
    if robot is None:
        raise refused[0] if refused else error_at(name, root, "the file has no model")
    lost = f"; or it is what can't be read: {refused[0]}" if refused else ""
    raise error_at(name, root, f"there is no model '{robot}'{did_you_mean(robot, known)}{lost}")


def _prepare(root: Any) -> None:
    """Remove comments, and write what a file leaves to SDF: second axes, and that axes were given in the model's frame
    before version 1.5."""
    etree.strip_tags(root, etree.Comment)
    for joint in root.iter("joint"):
        if joint.get("type") in TWO_AXES and joint.find("axis") is not None and joint.find("axis2") is None:
            etree.SubElement(joint, "axis2")
    version = [int(x) for x in numbers(root.get("version", "1.6").replace(".", " ")) or (1.0, 6.0)]
    if version < [1, 5]:
        for axis in root.iter("axis", "axis2"):
            etree.SubElement(axis, "use_parent_model_frame").text = "1"


def _expand(model: Any, place: _Place) -> None:
    """Replace each <include> in a model by the model that it includes."""
    for include in list(model.iter("include")):
        if include.getparent().tag == "model":
            _placed(include, place)


def _placed(include: Any, place: _Place) -> Any:
    """Replace an <include> by its model, with everything that this includes, and return that."""
    name, merges = str(place.path), include.get("merge", "false").strip() in _TRUE
    uri = include.findtext("uri", "").strip()
    for element in include.iterchildren("*"):
        if element.tag not in ("uri", "name", "pose", "placement_frame", "static", "plugin"):
            what = f"<{etree.QName(element).localname}> of the included '{uri}' is not read"
            raise error_at(name, element, f"{what}: write the model's content into the file")
    inner = _place_of(include, uri, place)
    model = _model_in(inner, include, name, uri)
    renamed, at, frame = (include.find(word) for word in ("name", "pose", "placement_frame"))
    if frame is not None and at is None:
        raise error_at(name, frame, "a <placement_frame> is placed by a <pose>: add it")
    model.set(FILE, str(inner.path))
    if renamed is not None:
        model.set("name", (renamed.text or "").strip())
    if frame is not None:
        model.set("placement_frame", (frame.text or "").strip())
    for word in ("pose", "static"):
        stated, old = include.find(word), model.find(word)
        if stated is not None:
            if old is not None:
                model.remove(old)
            model.insert(0, _of_file(copy.deepcopy(stated), name))
    model.extend(_of_file(copy.deepcopy(plugin), name) for plugin in include.iterchildren("plugin"))
    for file in model.iterfind(".//mesh/uri"):
        file.text = inner.name_of((file.text or "").strip())
    _expand(model, inner)
    parent = include.getparent()
    if merges and parent.tag != "model":
        raise error_at(name, include, f"only a model can merge the included '{uri}' with itself: leave out merge")
    if merges:
        model.set(MERGED, "1")
    parent.replace(include, model)
    return model


def _of_file(element: Any, name: str) -> Any:
    element.set(FILE, name)
    return element


def _place_of(include: Any, uri: str, place: _Place) -> _Place:
    """Return the file that an <include> names."""
    folder, name = place.path.parent, str(place.path)
    label = f"the included '{uri}'"
    scheme, has_scheme, rest = uri.partition("://")
    if scheme in ("http", "https"):
        fetched = "download it, for instance by `gz fuel download`, and name its folder"
        raise error_at(name, include, f"{label} is on a server: {fetched}")
    file = rest if scheme == "file" else "" if has_scheme else uri
    words = [uri] if not file or os.path.isabs(file) else [uri, f"model://{file}"]
    problems: list[RaffError] = []
    for word in words:
        try:
            path, top = _file_of(word.rstrip("/"), folder, place.find)
        except RaffError as error:
            problems.append(error)
            continue
        if path in place.trail:
            chain = " -> ".join(passed.name for passed in (*place.trail, path))
            raise error_at(name, include, f"{label} includes itself: {chain}")
        if len(place.trail) >= _MOST:
            raise error_at(name, include, f"{label} is the {_MOST}th file that another one includes: too many")
        scheme, _, rest = word.partition("://")
        root, prefix = place.root, place.prefix
        if scheme in ("model", "package") and rest and not rest.startswith("/"):
            package, *inner = rest.rstrip("/").split("/")
            inner = inner[:-1] if word.endswith(_ENDINGS) else inner
            root, prefix = (top, *top.parents)[len(inner)], f"{scheme}://{package}/"
        return _Place(path, root, prefix, (*place.trail, path), place.find)
    raise error_at(name, include, re.sub("^mesh '.*?'", lambda _: label, str(problems[0])))


def _file_of(uri: str, folder: Path, find: Callable[[str, Path], Path]) -> tuple[Path, Path]:
    """Return the SDF that a URI names, by its folder or itself, and that folder."""
    if uri.endswith(_ENDINGS):
        path = find(uri, folder)
        return path, path.parent
    try:
        config = find(f"{uri}/model.config", folder)
    except RaffError as error:
        try:
            path = find(f"{uri}/model.sdf", folder)
            return path, path.parent
        except MissingFileError:
            raise error from None
    listed = [
        (numbers(sdf.get("version", "0").replace(".", " ")) or [0.0], (sdf.text or "").strip())
        for sdf in parse_xml(read_text(config), str(config)).iter("sdf")
    ]
    file = max(listed, key=lambda entry: entry[0])[1] if listed else "model.sdf"
    return find(f"{uri}/{file}", folder), config.parent


def _model_in(place: _Place, include: Any, name: str, uri: str) -> Any:
    """Return the model in an included file, taken out of it."""
    root = parse_xml(read_text(place.path), str(place.path))
    if root.tag != "sdf":
        raise error_at(name, include, f"the included '{uri}' is no SDF: its first element is <{root.tag}>")
    _prepare(root)
    for model in root.iter("model"):
        if model.getparent().tag in ("sdf", "world"):
            model.getparent().remove(model)
            return model
    raise error_at(name, include, f"the included '{uri}' has no model: name one that has")
