"""Choose the dimensions of a five-bar that moves its tool in a rectangle of 300 by 200 mm as evenly as possible."""

# %% The question: in no direction should the tool be much slower or weaker than in another, anywhere in the rectangle.
import tempfile
from pathlib import Path

from cinegen.design import synthesize
from cinegen.plotting import draw_designs

folder = Path(tempfile.mkdtemp())
task = {
    "reach": {"x": "-150..150mm", "y": "300..500mm"},
    "objective": [{"minimise": "condition"}],
    "ties": ["link2.d = link4.d", "link5.d = tool.d", "link1.d = -1*link3.d"],
    "starts": 1,
}

# %% The alternatives: other bars on the same base; actuated joints as near to each other as gearboxes of 80 mm permit;
# and the same with bars that are together as long as they are now.
bars = {"link2.d": "150..500mm", "link5.d": "200..600mm"}
near = {**bars, "link3.d": "40..200mm"}
size = {"of": ["link2.d", "link4.d", "link5.d", "tool.d"], "most": "1.3m"}
designs = {
    "other bars": synthesize("five_bar", {**task, "parameters": bars}),
    "near joints": synthesize("five_bar", {**task, "parameters": near}),
    "near, same length": synthesize("five_bar", {**task, "parameters": near, "constraints": {"size": size}}),
}

# %% The comparison, at points that no optimiser saw: 1 would be the same speed in all directions.
print(f"as it is: condition number {designs['other bars'].before[0]:.2f}")
for name, design in designs.items():
    sizes = (design.parameters.text(p, x, 4) for p, x in zip(design.parameters.names, design.p, strict=True))
    print(f"{name}: condition number {design.check.condition:.2f}, {', '.join(sizes)}; all holds: {design.holds}")
robots = {"as it is": designs["other bars"].parameters.mechanism}
robots |= {name: design.parameters.mechanism_with(design.p) for name, design in designs.items()}
draw_designs(robots, designs["other bars"].task.reach).savefig(folder / "alternatives.png", dpi=150)

# %% The decision: without longer bars the condition number falls by a third, which is enough: that robot is built.
(folder / "five_bar.raff").write_text(designs["near, same length"].raff)
