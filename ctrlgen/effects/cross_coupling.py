"""Two axes that share a flexure, a damper or a mass: the motion of the one takes force on the other."""

from ctrlgen.effects import Effect, Expression, Family, LawInputs, LawNumbers, Param, Place


class CrossCoupling(Effect, listed=False):
    """Delta F_i = -g x_j, Delta F_j = -g x_i, x the displacement, the speed or the acceleration: one law, named once for each.

    One number for both directions, by Maxwell's and Betti's reciprocity.
    """

    place = Place.FORCE
    family = Family.CROSS_TALK
    pairs = True
    partner_unit = "channel"
    symmetric = True
    source = "L. Meirovitch, Fundamentals of Vibrations (2001), chapter 7: off-diagonal terms of K, C and M"


class StiffnessCoupling(CrossCoupling):
    """E = k d_i d_j, hence Delta F_i = -k d_j, Delta F_j = -k d_i. Holds for small displacements of elastic guides.

    A stage in balance without inertia shows the same as a share of the other's travel: that is `coupling`.
    """

    title = "A spring that two axes share"
    requires = frozenset({"force", "velocity"})
    params = (Param("stiffness", "channel/travel", (-10.0, 10.0), "cross stiffness", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.stiffness * s.displacements[s.partner]


class DampingCoupling(CrossCoupling):
    """Delta F_i = -c v_j, Delta F_j = -c v_i. Holds beside dampers of the axes themselves: it dissipates for c^2 <= c_i c_j."""

    title = "A damper that two axes share"
    requires = frozenset({"force", "velocity"})
    active = True
    params = (Param("damping", "channel*s/travel", (-100.0, 100.0), "cross damping", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.damping * s.velocities[s.partner]


class InertiaCoupling(CrossCoupling):
    """T = m v_i v_j, hence Delta F_i = -m a_j, Delta F_j = -m a_i. Holds for small displacements, and for a motion that is
    imposed: free axes would have to be solved together for their accelerations.
    """

    title = "A mass that two axes share"
    requires = frozenset({"force", "acceleration"})
    params = (Param("inertia", "channel*s^2/travel", (-1e3, 1e3), "cross inertia", off=0.0),)

    def term(self, s: LawInputs, p: LawNumbers) -> Expression:
        return -p.inertia * s.accelerations[s.partner]
