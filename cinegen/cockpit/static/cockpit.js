// The cockpit: any part of any robot is picked and moved. This puts the page's parts together.
//
// On the root element, for tests: data-frame (last state applied), data-connected, data-control, data-view ("ready" once
// the robots fill the view). `window.cockpit` is for tests and debugging. With ?camera=1 the scene alone is shown,
// for films; &aids=1 with aids.

import { Aids } from "./aids/aids.js";
import { Ellipsoids } from "./aids/ellipsoid.js";
import { Forecasts } from "./aids/forecast.js";
import { Targets } from "./aids/targets.js";
import { SingularMotions } from "./aids/singular_motions.js";
import { Marks } from "./aids/marks.js";
import { Limits } from "./aids/limits.js";
import { Hidden } from "./aids/hidden.js";
import { Obstructions } from "./aids/obstructions.js";
import { Reactions } from "./aids/reactions.js";
import { Trails } from "./aids/trail.js";
import { Commands } from "./bar/commands.js";
import { showProblems } from "./bar/file_problem.js";
import { Hints } from "./bar/hints.js";
import { keys } from "./bar/keys.js";
import { Messages } from "./bar/messages.js";
import { PartTasks } from "./bar/part_tasks.js";
import { Replay } from "./bar/replay.js";
import { Selection } from "./bar/selection.js";
import { Share } from "./bar/share.js";
import { Status } from "./bar/status.js";
import { byId } from "./base/dom.js";
import { Gamepad } from "./base/gamepad.js";
import { Link } from "./base/link.js";
import { Session } from "./base/session.js";
import { Film } from "./film/film.js";
import { ArrowKeys } from "./pointer/arrow_keys.js";
import { Drag } from "./pointer/drag.js";
import { Gizmo } from "./pointer/gizmo.js";
import { hover } from "./pointer/hover.js";
import { lookAt } from "./pointer/look.js";
import { Measure } from "./pointer/measure.js";
import { Pick } from "./pointer/pick.js";
import { Cells } from "./map/cells.js";
import { Field } from "./map/field.js";
import { Legend } from "./map/legend.js";
import { pointAtCells } from "./map/cell_pointer.js";
import { appearance } from "./panel/appearance.js";
import { Drawer } from "./panel/drawer.js";
import { Forces } from "./panel/forces.js";
import { Joints } from "./panel/joints.js";
import { MapSection } from "./panel/map.js";
import { Motion } from "./panel/motion.js";
import { Performance } from "./panel/performance.js";
import { Plots } from "./panel/plots.js";
import { Tasks } from "./panel/tasks.js";
import { Record } from "./panel/record.js";
import { Sensors } from "./panel/sensors.js";
import { Singularity } from "./panel/singularity.js";
import { Tree } from "./panel/tree.js";
import { Waypoints } from "./panel/waypoints.js";
import { frameFirstView } from "./view/first_view.js";
import { sendCamera } from "./view/camera.js";
import { ContactShadow } from "./view/contact_shadow.js";
import { lay } from "./view/floor.js";
import { Highlight } from "./view/highlight.js";
import { Instances } from "./view/instances.js";
import { Labels } from "./view/labels.js";
import { light } from "./view/lights.js";
import { Skeleton } from "./view/skeleton.js";
import { paint } from "./view/theme.js";
import { View } from "./view/view.js";
import { Cursors, sendCursor } from "./users/cursors.js";
import { Users } from "./users/profile.js";
import { offer } from "./xr/entry.js";
import { Presentation } from "./xr/presentation.js";

const parameters = new URLSearchParams(location.search);
const still = parameters.get("camera") === "1";
const withAids = !still || parameters.get("aids") === "1";
document.body.classList.toggle("camera", still);
document.body.classList.toggle("with-aids", withAids);

const view = new View(byId("scene"), { still });
const link = new Link(view);
const session = new Session(link);
const field = new Field(session);
session.on("hello", ({ title }) => {
  document.title = byId("title").textContent = byId("title").title = title; // another session may be served here now
  view.forget();
  view.background = new Set(session.obstacles.filter(({ mobility }) => mobility === 0).map(({ name }) => name));
});
session.on("state", (state) => { // before all that asks where things are
  view.apply(session.robots, state.poses);
  view.apply(session.obstacles, state.obstacles);
});

paint(view);
light(view);
new Instances(view);
new ContactShadow(view, lay(view));
const labels = new Labels(view);
const highlight = new Highlight(view, session);
const aids = new Aids(!withAids);
const shown = { view, session, labels, aids, highlight };
for (const Aid of [Targets, SingularMotions, Ellipsoids, Forecasts, Trails, Limits, Marks, Obstructions, Reactions]) new Aid(shown);

const pick = new Pick(view, session);
new Skeleton({ ...shown, pick });
const gizmo = new Gizmo(view, session, pick);
const drag = new Drag({ view, session, pick, gizmo });
hover({ ...shown, drag });
const drawer = new Drawer();
const { pose, tasks, analyse, record, view: shows } = drawer.pages;
const measure = new Measure({ ...shown, pick });
new ArrowKeys({ view, session, gizmo, drag });
const cells = new Cells({ view, field });
const legend = new Legend({ view, field });
pointAtCells({ ...shown, field, cells, legend, drag, pick });

/** End the drag, with a pin at the target if wanted. Return whether there was one. */
function endDrag(pinned = false) {
  const busy = [drag, gizmo].filter((input) => input.part !== null && (input !== gizmo || gizmo.busy));
  for (const input of busy) input.end(pinned);
  return busy.length > 0;
}

/** Pin what is dragged at its target, or otherwise what is selected at its present pose. */
function pin() {
  if (endDrag(true) || session.selected === null || !session.mayAct()) return;
  session.send({ type: "pin", ...session.selected });
}

const commands = new Commands({ session, endDrag });
appearance(shows, aids, view);
const presentation = new Presentation({ ...shown, pick, endDrag });
offer(presentation, session);
new Messages(session);
if (!still) new Hints({ view, session, labels, draggings: [drag, gizmo, presentation.handDrags] });
showProblems(session);
function look() {
  if (session.selected !== null) lookAt(view, session.selected);
}
const hidden = new Hidden({ view, session });
const { bar, more } = new Selection({ view, session, hidden, gizmo, pin, look });
const partTasks = new PartTasks({ session, view, pick, measure, bar, more });
drag.on("free", (event) => {
  if (cells.met(pick.aim(event)) === null) session.select(null, null);
});
const driving = (/** @type {object | null} */ part) => view.pane.parentElement?.classList.toggle("driving", part !== null && !gizmo.stepping);
drag.on("drag", driving);
gizmo.on("drag", driving);
new Status({ session, view, labels });
new Replay(session);
new Cursors(shown);
sendCursor({ view, session, drag });
new Gamepad(session);
for (const Section of [Joints, Tree]) new Section(pose, session);
for (const Section of [Tasks, Sensors, Motion]) new Section(tasks, session);
new Singularity(analyse, session);
new MapSection(analyse, field);
new Forces(analyse, session, aids);
const plots = new Plots(analyse, session);
for (const Section of [Waypoints, Record]) new Section(record, session);
new Share(record, { view, session });
new Film({ view, session });
new Users(shows, session);
const readings = new Performance(shows, { view, session, open: parameters.get("debug") === "1" });
for (const input of [drag, gizmo]) input.target.sent = (position) => readings.sent(position);
sendCamera(view, session);
frameFirstView(view, session, still, field);
keys({ commands, drawer, gizmo, session, view, measure, partTasks, endDrag, pin, look });

window.cockpit = {
  viewer: view.viewer,
  get root() {
    return view.root;
  },
  pick,
  field,
  cells,
  labels,
  select: (/** @type {string} */ robot, /** @type {string} */ node) => session.select(robot, node),
  frame: () => view.frame(),
  view,
  gizmo,
  plots,
  presentation,
  get hello() {
    return session.hello;
  },
  get state() {
    return session.state;
  },
  get report() {
    return session.report;
  },
  send: (/** @type {ClientMessage} */ message) => session.send(message),
};
link.connect();
