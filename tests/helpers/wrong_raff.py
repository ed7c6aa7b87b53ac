"""RAFF text with errors, and where they are."""

# Figure 5, as printed, of L. Flückiger, L. Piguet, C. Baur: "Generic robotic kinematic generator for virtual
# environment interfaces". Two slips of the printer are in it: `alphah`, and a brace that closes link 2 too early.
FIGURE_5 = """\
RAFF MiniDelta

robot r1 {

  // path for the graphic files
  path "~/GKG/Models/delta-4/"

  // here's the base of robot
  base { filename { "platform.dxf" } }

  link 1 { // first link of the robot
    parameters {
      theta 0.0 // in degrees
      r 0.0 // in mm
      d 1500.0 // in mm
      alpha 90.0 // in degrees
    }
    type 2 // type of joint 2=revolute
    pred 0 // predecessor = base (0)
    limits { -85.0 80.0 }
    filename { "bras.nff" }
  }

  link 2 { // second link of the robot
    parameters {
      theta 211.21
      r 0.0
      d 2000.0
      alphah 0.0
    }
  }

  type 2
  pred 1 // attached to link 1
  limits { 185.0 355.0 }
}

// another link connected to the base
link 6 {
  parameters {
    theta 0.0
    r 0.0
    d 1500.0
    alpha 90.0
    gamma 120.0 // some extra params
    epsilon 0.0 // for this branch
  }
  type 2
  pred 0
  limits { -85.0 80.0 }
  filename { "bras.nff" }
}

// define the constraint for a closed loop
constraint {
  link 5 // this two link must
  link 11 // be connected
}

} // end of robot definition
"""


def assert_in_order(words: str, said: str) -> None:
    """Words, parted by blanks, stand in a text one behind another."""
    rest = said
    for word in words.split():
        assert word in rest, f"{word} is missing, or stands too early, in: {said}"
        rest = rest.split(word, 1)[1]


# --- of the grammar -------------------------------------------------------------------------------------------------

LINK = "RAFF t\nrobot r {\n  link 1 {\n    "  # what follows stands on line 4, from column 5
END = "\n  }\n}\n"

WRONG_TEXTS = [
    # words
    (f"{LINK}type 2 pred 0 limts {{ 0 1 }}{END}", 4, 19, "unknown word 'limts' link 1 did you mean 'limits'"),
    (f"{LINK}type 2 pred 0 parameters {{ thta 1 }}{END}", 4, 32, "unknown parameter 'thta' did you mean 'theta'"),
    ("RAFF t\nrobot r {\n  Link 1 { type 2 pred 0 }\n}", 3, 3, "unknown word 'Link' did you mean 'link'"),
    ("RAFF t\nrobot r {\n  frame 1 { type 2 pred 0 }\n}", 3, 13, "'type' does not belong frame 1 'link"),
    ("RAFF t\nrobot r { }\nlink 1 { type 2 pred 0 }", 3, 1, "'link' is outside a robot robot r closed on line 2"),
    ('RAFF t\nrobot r {\n  sensor 1 { port "x" }\n}', 3, 3, "'sensor' outside robot"),
    # braces
    ("RAFF t\nrobot r {\n  link 1 {\n    type 2\n    pred 0", 5, 11, "ends inside link 1 line 3 '}' missing"),
    ("RAFF t\nrobot r {\n  link 1 { type 2 pred 0 }\n", 3, 27, "ends inside robot r line 2 '}' missing"),
    ("RAFF t\nrobot r {\n}\n}", 4, 1, "'}' too many robot r closed on line 3"),
    (f"{LINK}type 2 pred 0 limits 0 1{END}", 4, 26, "expected '{' found '0'"),
    # numbers
    ("RAFF t\nrobot r {\n  link one { type 2 pred 0 }\n}", 3, 8, "'link' needs a number 'one'"),
    (f"{LINK}type revolute pred 0{END}", 4, 10, "'type' needs a number 'revolute' 2 revolute"),
    (f"{LINK}type 2 pred 0 parameters {{ d NaN }}{END}", 4, 34, "'d' needs a number 'NaN'"),
    (f"{LINK}type 2 pred 0 parameters {{ d 1e400 }}{END}", 4, 34, "'1e400' too large"),
    (f"{LINK}type 2 pred 0 parameters {{ d \u0663\u0660 }}{END}", 4, 34, "'d' needs a number '\u0663\u0660'"),  # Arabic
    (f"{LINK}type 2 pred 0 limits {{ 1 }}{END}", 4, 30, "'limits' needs two numbers"),
    (f"{LINK}type 2 pred 0.5{END}", 4, 17, "'0.5' whole number"),
    ("RAFF t\nrobot r { link 0 { type 2 pred 0 } }", 2, 16, "'0' whole number from 1"),
    ("RAFF t\nrobot r { constraint { base sensor ( ) } }", 2, 38, "'sensor' needs a number"),
    # texts
    (f'{LINK}name "tool{END}', 4, 10, "not closed on its line '\"' missing"),
    (f"{LINK}type 2 pred 0 name tool{END}", 4, 24, "expected text found 'tool'"),
    (f"{LINK}type 2 pred 0 filename {{ a.stl }}{END}", 4, 30, 'expected text "..." \'a.stl\''),
    (f"{LINK}type 2 / pred 0{END}", 4, 12, "lone '/' comments begin with '//'"),
    # the file's beginning
    ("", 1, 1, "begins with 'RAFF <name>'"),
    ("robot r { }", 1, 1, "begins with 'RAFF <name>' not with 'robot'"),
    ("RAFF\nrobot r { }", 1, 1, "'RAFF <name>'"),
    # given twice
    (f"{LINK}type 2 pred 0\n    type 1{END}", 5, 10, "'type' given twice in link 1 first on line 4"),
    ("RAFF t\nunits mm\nunits cm", 3, 7, "'units' given twice first on line 2"),
    (f"{LINK}type 2 pred 0 inertial {{ mass 1kg }}{END}", 4, 35, "'mass' needs a number '1kg' write 1 masses in kg"),
    (f"{LINK}type 2 pred 0 mass 1{END}", 4, 19, "'mass' does not belong in link 1, but in 'inertial { }'"),
    ("RAFF t\ngravity { 0 -9.81 }", 2, 19, "'gravity' needs a number here"),
    ("RAFF t\ngravity { 0 0 1 } gravity { 0 0 1 }", 2, 29, "'gravity' is given twice in the file"),
    (f"{LINK}joint bal pred 0{END}", 4, 11, "unknown joint 'bal': did you mean 'ball'?"),
    (f"{LINK}joint ball pred 0 variable tx {{ }}{END}", 4, 32, "a ball joint has no variable 'tx' known: x, y, z"),
    # what does not exist
    (f"{LINK}type 3 pred 0{END}", 4, 10, "joint type 3 unknown 0 fixed 1 prismatic 2 revolute"),
    (f"{LINK}type 2 pred 0 actuated 2{END}", 4, 28, "'actuated' 2 unknown 0 1"),
    (
        "RAFF t\nrobot r { link 1 { type 2 pred 0 }\n  constraint { base link 1 type 4 } }",
        3, 33, "loop type 4 unknown 0 rigid 1 prismatic 2 revolute 3 ball",
    ),
    ("RAFF t\nunits inch", 2, 7, "unknown unit 'inch' um mm cm m"),
    ('RAFF t\nsensor 1 { port "x" translation 4 }', 2, 33, "'translation' 4 unknown 0 1 2 3"),
    # what is missing
    ("RAFF t\nrobot r { link 7 { type 2 } }", 2, 16, "link 7 no 'pred'"),
    ("RAFF t\nsensor 7 { }", 2, 8, "sensor 7 no 'port'"),
    ("RAFF t\nrobot r { link 1 { type 2 pred 0 }\n  constraint { link 1 } }", 3, 21, "constraint must name two nodes"),
    (
        "RAFF t\nrobot r { link 1 { type 2 pred 0 }\n  constraint { base link 1 sensor ( 0 ) } }",
        3, 16, "constraint with sensors must name one node",
    ),
]  # fmt: skip
"""A text, line and column of its error, and words of it."""

# --- beyond it ------------------------------------------------------------------------------------------------------


def text_of(body: str, after: str = "") -> str:
    """`body` begins on line 3."""
    return f"RAFF test\nrobot r {{ base {{ }}\n{body}\n}}\n{after}"


ONE = "link 1 { type 2 pred 0 }"

WRONG_BODIES = [
    # parents
    ("link 1 { type 2 pred 7 }", 3, 22, "link 1 7 does not exist 0 (the base)"),
    # cycles
    ("link 9 { type 2 pred 1 }\nlink 1 { type 2 pred 2 }\nlink 2 { type 2 pred 1 }", 4, 22, "link 1 cycle 1 -> 2 -> 1"),
    # numbers
    (f"{ONE}\nlink 1 {{ type 2 pred 0 }}", 4, 6, "number 1 defined twice first on line 3"),
    # names
    (f'{ONE}\nlink 2 {{ type 2 pred 0 name "link1" }}', 4, 29, "'link1' link 1 choose another"),
    ('link 1 { type 2 pred 0 name "a" }\nframe 2 { pred 0 name "a" }', 4, 23, "'a' link 1 choose another"),
    ('link 1 { type 2 pred 0 name "base" }', 3, 29, "'base' reserved the root"),
    ('frame 1 { pred 0 name "" }', 3, 23, "'' can't name a frame"),
    ('frame 1 { pred 0 name "a<b" }', 3, 23, "'a<b' can't name a frame"),
    ('frame 1 { pred 0 name "\u0301a" }', 3, 23, "can't name a frame"),
    # limits
    ("link 1 { type 2 pred 0 limits { 80 -85 } }", 3, 33, "lower limit 80 link 1 above upper limit -85 swap"),
    ("link 1 { type 2 pred 0 velocity 0 }", 3, 33, "velocity link 1 above 0"),
    ("link 1 { type 1 pred 0 effort 0 }", 3, 31, "effort link 1 is 0 above 0 (N m or N)"),
    ("link 1 { joint ball pred 0 effort 2 }", 3, 35, "ball joint link 1 several variables 'effort' 'variable x { }'"),
    # loops
    (f"{ONE}\nconstraint {{ link 1 link 11 }}", 4, 26, "loop 11 does not exist"),
    (f"{ONE}\nconstraint {{ link 1 link 1 type 2 }}", 4, 19, "loop joins 1 to itself"),
    # sensors
    (f"{ONE}\nconstraint {{ link 2 sensor ( 0 ) }}", 4, 19, "sensor constraint 'r' 2 does not exist"),
    (f"{ONE}\nconstraint {{ link 1 sensor ( 0 4 ) }}", 4, 32, "sensor 4 not declared"),
    # masses, inertia of rotors, friction
    ("link 1 { type 2 pred 0 inertial { mass -1 } }", 3, 40, "the mass of link 1 is -1 kg it must not be negative"),
    ("link 1 { type 2 pred 0 inertial { density 0 radius 1 } }", 3, 43, "density of link 1 is 0 must be above 0"),
    ("link 1 { type 2 pred 0 armature -1 }", 3, 33, "the armature of link 1 is -1 it must not be negative"),
    ("link 1 { joint universal pred 0 damping 1 }", 3, 41, "write 'damping' for one of them, in 'variable z"),
    # couplings
    (f"{ONE}\nlink 2 {{ type 2 pred 1 }}\ncoupling {{ link 2 link 1 ratio 0 }}", 5, 24,
     "link 1 does not drive link 2 'ratio' is 0"),
]  # fmt: skip
"""The body of a robot, line and column of its error, and words of it; see `text_of`."""
