"""A rate-independent memory of an axis' displacement, measured and not explained."""

from ctrlgen.effects import Effect, Expression, LawInputs, LawNumbers, Param, Place
from ctrlgen.effects._play_operators import ELEMENTS, lags, play_states, radii, updated_plays


class EmpiricalHistory(Effect):
    """Delta y = A sum_j c_j (d - P_j)/r_j, j = 1..8: P_j the play of d with radius r_j = r j/8, d the displacement of the axis `of`.

    Weights of any sign, so that the loops need be none of a joint or a contact. It names no cause: a diagnosis writes it where
    what is left is a function of the last reversals and no law reaches it. Holds for travels as recorded.
    """

    place = Place.POSE
    pairs = True
    partner_place = Place.DISPLACEMENT
    source = "K. Kuhnen, Eur. J. Control 9 (2003) 407: play operators; the weights from a recording"
    params = (
        Param("size", "channel", (0.0, 10.0), "A: what the weights are counted in", off=0.0),
        Param("reach", "travel", (1e-4, 10.0), "r: radius of the widest play"),
        *(Param(f"c{j}", "1", (-100.0, 100.0), "weight of one play") for j in range(1, ELEMENTS + 1)),
    )
    states = tuple(state for state in play_states("travel") if not state.per_record)  # each begins in its middle

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        widths = radii(p.reach)
        behind = zip(lags(s, s.displacements[s.partner], widths), widths, strict=True)
        return p.size * sum(getattr(p, f"c{j}") * lag / r for j, (lag, r) in enumerate(behind, start=1))

    def update(self, s: LawInputs, p: LawNumbers) -> dict[str, Expression]:
        return updated_plays(s, [s.displacements[s.partner]], radii(p.reach))
