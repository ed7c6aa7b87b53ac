"""A campaign against everything that reads, ticks, serves or writes: `python -m campaign --help`, with `tests` on the
path. Each case is made from its number alone; see `docs/limits.md`."""
