// Types that many of the page's modules name.

type Session = import("./session.js").Session;
type KnownRobot = import("./session.js").KnownRobot;
type Part = import("./session.js").Part;
type Hello = import("./link.js").Hello;
type State = import("./link.js").State;
type SessionReport = import("./link.js").Report;
type ClientMessage = import("./link.js").ClientMessage;
type View = import("../view/view.js").View;
type Labels = import("../view/labels.js").Labels;
type PartHighlight = import("../view/highlight.js").Highlight;
type Aids = import("../aids/aids.js").Aids;
type Field = import("../map/field.js").Field;
type Touched = import("../pointer/pick.js").Touched;
type At = import("../pointer/pick.js").At;
type Gizmo = import("../pointer/gizmo.js").Gizmo;
type Drag = import("../pointer/drag.js").Drag;
type Hand = import("../xr/hand.js").Hand;
type World = import("../xr/world.js").World;
