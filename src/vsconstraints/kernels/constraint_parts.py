"""stub"""


class NotCompiled(Exception):
    """Something has no compiled form; says what."""


def demand(part, kind):
    if type(part) is not kind:
        raise NotCompiled(f"the {kind.__name__} {type(part).__name__}")


def write_motion(record, motion):
    k = motion.size
    record["velocity"][:k], record["amplitude"][:k] = motion.velocity, motion.amplitude
    record["rate"], record["phase"] = motion.rate, motion.phase


class Parts:
    def __init__(self, constraints):
        self.forms = []
        self.parameters = 0
        self.others = []
        first = 0
        for c, count, points in constraints.blocks():
            self.others.append((c, slice(first, first + count), points))
            first += count

    def write(self, step, known):
        pass
