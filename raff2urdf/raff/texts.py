"""The texts of every error and warning about RAFF text, as templates of `str.format`."""

from __future__ import annotations

# --- words ----------------------------------------------------------------------------------------------------------

DID_YOU_MEAN = ": did you mean '{word}'?"
KNOWN = " (known: {listed}{more})"
MORE_PROBLEMS = "and {count} more"
DEFINED_TWICE = "{what} is defined twice{first}: change one of them{hint}"
TO_NUMBER = ", probably this one to {number}, which is named and missing"
FIRST_ON_LINE = ", first on line {line}"

# --- lines and tokens -----------------------------------------------------------------------------------------------

LONG_LINE = "line {line} is {length} characters long; at most {most} are allowed"
OPEN_TEXT = "this text is not closed on its line: a '\"' is missing"
LONE_SLASH = "a lone '/': comments begin with '//'"
UNEXPECTED_CHARACTER = "unexpected character {character}: write a space for it"

# --- statements -----------------------------------------------------------------------------------------------------

NO_HEADER = "a RAFF file begins with 'RAFF <name>', not with '{found}'{hint}"
IS_XML = ": a URDF, SDF or MJCF is read by its ending"
ENDS_BEFORE_HEADER = "the file ends too early: a RAFF file begins with 'RAFF <name>'"
HEADER_ON_TWO_LINES = "a RAFF file begins with 'RAFF <name>', both on one line"
ENDS_INSIDE = "the file ends inside {label}, opened on line {line}: a '}}' is missing"
ENDS_EARLY = "the file ends too early: {missing} is missing"
EXPECTED = "expected {wanted} here, found '{found}'"
QUOTE_IT = "{message}: put it in quotation marks"
NOT_A_NUMBER = "'{word}' needs a number, and '{found}' is not one{hint}"
HAS_UNIT = ": write {value}{why}"
NO_UNITS = " (numbers have no unit: lengths are in the file's `units`, here {units}; angles in degrees, masses in kg)"
DECIMAL_POINT = ": write {value}"
A_KIND = ": write 'type {value}'"
NEEDS = "'{word}' needs {wanted} here"
GIVEN_TWICE = "'{word}' is given twice in {label}, first on line {line}: remove one of them"
LACKS = "{label} has no '{word}'{meaning}: add it"
BRACE_TOO_MANY = "one '}}' too many: {remedy}"
WAS_CLOSED = "{label} was closed on line {line}"
REMOVE_IT = "remove it"
UNEXPECTED = "unexpected '{found}' in {label}: expected {listed}"
BELONGS_OUTSIDE = "'{word}' is inside {label}: it belongs outside every robot"
IS_OUTSIDE = "'{word}' is outside {home}: {closed}; remove that '}}'"
A_PARAMETER_BLOCK = "a parameter block"
A_BLOCK = "a {kind}"
UNKNOWN_PARAMETER = "unknown parameter '{word}'{hint}"
BELONGS_IN = "'{word}' does not belong in {label}, but in {homes}"
UNKNOWN_WORD = "unknown word '{word}' in {label}{hint}"

# --- values ---------------------------------------------------------------------------------------------------------

TOO_LARGE = "'{found}' is too large for a number: the largest is 1.8e308"
NOT_WHOLE = "'{found}' must be a whole number from {least}"
WHOLE_TOO_LARGE = "'{found}' is too large for a whole number: the largest is {most}"
UNKNOWN_CHOICE = "{what} {found} is unknown (known: {known})"
UNKNOWN_JOINT = "unknown joint '{found}'{hint}"
UNKNOWN_UNIT = "unknown unit '{found}' (known: {known})"
NO_AXIS = "'{found}' is no axis of a sensor: write {known}, or 0 for none; with a sign or a factor, such as -0.5*rx"
AXIS_MISSING = "an axis is missing here: write 0 for none"
AXIS_TOO_MANY = "'{found}' is a seventh axis: remove it; x, y, z, rx, ry and rz are commanded"
AXIS_FACTOR = "the factor of '{found}' is too large: write {largest:g}*{axis} at most"
AXIS_TWICE = "'{axis}' would command both {first} and {second}: write 0 for one of them, or another axis"
SENSORS_OF_ONE_NODE = "a constraint with sensors must name one node, and no type"
TWO_NODES = "a constraint must name two nodes (a loop), or one node and the sensors that it may follow"
DRIVES_NOTHING = "'{word}' belongs after a link that drives; the first link of a coupling follows"
NAMES_NO_DRIVE = "a coupling must name the link that follows, and then those that drive it: link 5 link 3 ratio -2"
NEEDS_DRIVE = "link {link} drives a coupling: state its 'ratio', 'lead', 'radius' or 'polynomial'"

# --- the whole file -------------------------------------------------------------------------------------------------

NO_ROBOT = "the file has no robot: add 'robot NAME {{ }}'"
NO_SUCH_ROBOT = "there is no robot '{name}'{hint}"
BAD_NAME = (
    "'{name}' can't name a {keyword}: "
    "a name begins with a letter or '_', and has only letters, digits, '_', '-' and '.' (it becomes an XML name)"
)
RESERVED_NAME = "the name '{name}' is reserved for {owner}: choose another one"
NAME_TAKEN = "the name '{name}' is that of {keyword} {number}: choose another one"
NO_PARENT = "the parent of {keyword} {number} is {pred}, which does not exist{known}"
THE_BASE = "0 (the base)"
CYCLE = "{keyword} {number} is part of a cycle of parents: {shown}: change the 'pred' of one of them{hint}"
TO_BASE = ", such as to 'pred 0' in {keyword} {number}"
SMALL = (
    "all lengths of robot '{robot}' are below {least:g} mm, the longest is {size} mm: did you mean metres? "
    "Write 'units m' after the first line, or 'units mm' if they are in mm"
)
LENGTH_TOO_LARGE = "{word} of {node} is beyond {largest:g} m, the largest length"
INERTIAL_TOO_LARGE = "'{word}' of the inertial of {node} is beyond {largest:g} in SI units, the largest"
COEFFICIENTS_TOO_LARGE = (
    "what link {link} adds to link {follower} has coefficients beyond {largest:g} in SI units, or all below {least:g}"
)
OFFSET_TOO_LARGE = "the 'offset' of link {follower} in a coupling is beyond {largest:g} in SI units, the largest"

# --- joints ---------------------------------------------------------------------------------------------------------

LIMITS_REVERSED = "the lower limit {low:g} of {what} is above its upper limit {high:g}: swap them"
VELOCITY_TOO_SMALL = "the velocity limit of {what} is {value:g}: {too_slow}"
TOO_SLOW = "it must be above 0, and not as slow as {least:g} rad/s or m/s; or left out"
EFFORT_TOO_SMALL = "the effort limit of {what} is {value:g}: it must be above 0 (N m or N), or left out"
BELOW_0 = "the {word} of {what} is {value}: it must not be negative"
GRAVITY_TOO_LARGE = "a number of 'gravity' is beyond {largest:g} m/s2, the largest"
DYNAMICS_TOO_LARGE = "the {word} of {joint} is beyond {largest:g} in SI units, the largest"
NO_VARIABLES = "{what} has variables but no joint that has several: remove them, or write 'joint' for 'type'"
TYPE_AND_JOINT = "{what} has both 'type' and 'joint': remove one of them"
IN_A_VARIABLE = (
    "the {compound} joint of {what} has several variables: write '{word}' for one of them, in 'variable {first} {{ }}'"
)
NO_SUCH_VARIABLE = "a {compound} joint has no variable '{name}'{known}"
HOME_IS_PARAMETER = "the home of {what} is '{parameter}' of its parameters: write it there"
NAME_NEEDED = "the name '{name}' is needed for a joint of {what}: choose another one"

# --- masses ---------------------------------------------------------------------------------------------------------

NO_MASS = "the inertial of {what} has no 'mass' (kg), nor a 'density' (kg/m3)"
NEGATIVE_MASS = "the mass of {what} is {mass:g} kg: it must not be negative"
NOT_ABOVE_0 = "the {quantity} of {what} is {value}: it must be above 0"
RADIUS_OF_BARS = "'radius' of {what} is that of bars of a 'density': add it, or remove 'radius'"
DENSITY_AND_MASS = "{what} has a 'density', from which '{other}' follows: remove one of them"
DENSITY_OF_NOTHING = "{what} has a 'density' but no graphics: name files, or give the 'radius' of its bars"

# --- constraints ----------------------------------------------------------------------------------------------------

NO_END = (
    "a loop of robot '{robot}' ends at {number}, which does not exist{known}: add 'frame {number}', or name another one"
)
LOOP_TO_ITSELF = "a loop joins node {number} to itself: name two different nodes"
NO_NODE = "a sensor constraint of robot '{robot}' names {number}, which does not exist{known}"
NO_SENSOR = "sensor {number} is not declared (declared: {declared})"
NONE = "none"
NAME_OF_COUPLING = "the name '{name}' is that of another coupling: choose another one"
NAME_OF_LOOP = "the name '{name}' is that of a loop: choose another one"
COUPLES_COMPOUND = (
    "a coupling names link {number}, whose {compound} joint has several variables: write it as successive links, each "
    "with a 'type'"
)
COUPLES_NOTHING = "a coupling names link {number}, which is not a link that moves: name another one{known}"
COUPLED_TWICE = "a coupling names link {number} twice: name another one{known}"
RATIO_OF_TWO_TYPES = (
    "'ratio' couples joints of one type, but link {follower} is {own} and link {link} {other}: use 'lead' (a screw) or "
    "'radius' (a rack)"
)
SCREW_OF_ONE_TYPE = (
    "'{word}' couples a prismatic and a revolute joint, but links {follower} and {link} are both {own}: use 'ratio'"
)
DRIVES_BY_0 = "link {link} does not drive link {follower}: its '{word}' is 0"

# --- closing loops --------------------------------------------------------------------------------------------------

STAY_OPEN = "the mechanism can't be closed: these {what} remain open: {listed}"
LOOPS = "loops"
LOOPS_AND_COUPLINGS = "loops and couplings"
REWRITE = "write '{after}' for '{before}' in {where}{line}"
DRAWN_CLOSED = "one edit closes the loops as written: {edits}"
FREED = "one edit lets the loops move: {edits}"
FROZEN = "no joint can move: {rows} equations of loops and couplings, of rank {rank}, hold all {joints} joints"
DRAWN_OPEN = "the loops are open as written, and were closed elsewhere; {edit}"
OR = ", or "
AND = " and "

# --- warnings -------------------------------------------------------------------------------------------------------

LOOP_TWICE = "this loop was declared before{first}: remove one of them"
LARGE = "the longest length of robot '{robot}' is {size} m: if lengths are in mm, write 'units mm' for 'units m'"
ANGLE_IN_RADIANS = "'{word} {value}' of {what} is {angle} in radians: angles are in degrees, write '{word} {degrees}'"
LIMITS_IN_RADIANS = (
    "the limits of {what} are {degrees} degrees if they are in radians: angles are in degrees, write "
    "'limits {{ {degrees} }}'"
)
MOMENTS_IN_M = (
    "the moments of {what} are those of a body of {size} mm: if they are in kg m2, write 'moments {{ {moments} }}'"
)

NO_BODY = "no body can have the inertia of {node}: {why}; no forces can be computed"
MASS_NEGATIVE = "its mass is negative, {mass:.6g} kg"
MOMENTS_WITHOUT_MASS = "it has moments of inertia, up to {moment:.6g} kg m2, but no mass: state its mass"
MOMENT_NEGATIVE = "a principal moment of inertia is negative, {moment:.6g} kg m2"
MOMENT_TOO_LARGE = (
    "a principal moment of inertia, {moment:.6g} kg m2, exceeds the sum of the others, {least:.6g} and {middle:.6g}"
)
FIXED_HAS = "link {number} is fixed, so '{word}' has no effect: remove it"
HOME_OUTSIDE = "home {home} of {what} is outside its limits {low} to {high}: change either{hint}"
IN_RADIANS = "; if these are radians, write 'limits {{ {low} {high} }}'"
USELESS_EFFORT = "the joint of {what} is passive, so 'effort' has no effect: remove it, or write 'actuated 1'"
