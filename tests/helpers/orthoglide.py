"""The Orthoglide, a translational robot with three orthogonal prismatic joints (Wenger and Chablat), as RAFF."""

from scipy.spatial.transform import Rotation

SLIDES = {1: (90.0, 90.0), 2: (180.0, 90.0), 3: (0.0, 0.0)}  # gamma, alpha (degrees) that put a slide along x, y, z


def orthoglide(length: float = 400.0) -> str:
    """Return a RAFF file: bars of a length (mm), home where the bars are along the slides and the tool at the origin.

    Each leg is PUU, which moves the platform as the parallelograms of the original do.
    """
    turned = Rotation.from_euler("ZXZ", (0.0, 90.0, 180.0), degrees=True)
    wrist = {leg: Rotation.from_euler("ZX", angles, degrees=True) * turned for leg, angles in SLIDES.items()}
    nodes, joints = [], []
    for leg, (gamma, alpha) in SLIDES.items():
        first = {1: 1, 2: 6, 3: 12}[leg]
        nodes.append(
            f"link {first} {{ parameters {{ gamma {gamma} alpha {alpha} r {length} }} type 1 pred 0 actuated 1 }}"
        )
        for k, text in enumerate(("theta 270 alpha 90", "alpha 90", f"d {length}", "theta -90 alpha -90"), 1):
            nodes.append(f"link {first + k} {{ parameters {{ {text} }} type 2 pred {first + k - 1} }}")
        if leg > 1:
            g, a, t = (wrist[leg].inv() * wrist[1]).as_euler("ZXZ", degrees=True, suppress_warnings=True)
            nodes.append(
                f"link {first + 5} {{ parameters {{ gamma {g} alpha {a} theta {t} }} type 0 pred {first + 4} }}"
            )
            joints.append(f"constraint {{ link 5 link {first + 5} }}")
    nodes.append('frame 20 { name "tool" parameters { alpha 90 } pred 5 }')
    body = "\n".join([*nodes, *joints, "constraint { frame 20 sensor ( 0 1 ) }"])
    return f"RAFF Orthoglide\nrobot orthoglide {{\nbase {{ }}\n{body}\n}}\nsensor 1 {{\n" + (
        'port "/dev/ttyS0"\ntranslation 3\nrotation 3\n}\n'
    )
