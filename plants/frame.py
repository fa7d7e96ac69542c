"""A frame of rigid bodies and elastic links at finite rotations, solved for static equilibrium by Exudyn.

Every elastic part is the two-node geometrically exact element interpolated on SE(3): with the pose of node
1 seen from node 0, H = H_0^-1 H_1, its strain is e = log(H)/l - e_x, constant along the element, its
energy l/2 e' D e. D = diag(EA, GA_y, GA_z, GJ, EI_y, EI_z) is the section's stiffness.

A beam of length l is divided into n elements; GA_y = 12 EI_z/l_e^2 gives each element the bending
flexibility that one constant curvature lacks (MacNeal's residual bending flexibility), so that one element is
already exact in the linear limit; what n refines is the geometric nonlinearity.

Lengths in um, forces in N, moments in N um.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

try:
    import exudyn as exu
    import exudyn.itemInterface as eii
except ModuleNotFoundError as missing:
    raise ModuleNotFoundError("plants/ needs Exudyn: pip install ctrlgen[plant]") from missing

Array = np.ndarray


@dataclass(frozen=True)
class Pose:
    """Position `p` (3,) [um] and rotation `R` (3, 3) in the global frame."""

    p: Array
    R: Array

    def __matmul__(self, other: Pose) -> Pose:
        return Pose(self.p + self.R @ other.p, self.R @ other.R)

    def at(self, x: float = 0.0, y: float = 0.0, z: float = 0.0, turn_z: float = 0.0) -> Pose:
        """The pose at local (x, y, z) [um], turned by `turn_z` [rad] about local z."""
        return self @ Pose(np.array([x, y, z], dtype=float), about_z(turn_z))

    def inverse(self) -> Pose:
        """The pose of the global frame seen from here."""
        return Pose(-self.R.T @ self.p, self.R.T)


def about_z(angle: float) -> Array:
    """Rotation about z, (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _from_angles(angles: Array) -> Array:
    """R = X(a) Y(b) Z(c), (3, 3)."""
    (ca, cb, cc), (sa, sb, sc) = np.cos(angles), np.sin(angles)
    X = np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]])
    Y = np.array([[cb, 0, sb], [0, 1, 0], [-sb, 0, cb]])
    return X @ Y @ np.array([[cc, -sc, 0], [sc, cc, 0], [0, 0, 1]])


def _to_angles(R: Array) -> Array:
    """(a, b, c) with R = X(a) Y(b) Z(c), |b| < pi/2."""
    b = np.arcsin(np.clip(R[0, 2], -1, 1))
    if abs(R[0, 2]) > 1 - 1e-6:
        raise ValueError("a node's local z lies along global x, where its three angles are singular")
    return np.array([np.arctan2(-R[1, 2], R[2, 2]), b, np.arctan2(-R[0, 1], R[0, 0])])


def skew(v: Array) -> Array:
    """[v x], (3, 3)."""
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0.0]])


def rotation_vector(R: Array) -> Array:
    """log R as a vector (3,) [rad], for angles below pi/2; keeps its digits for small angles."""
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2
    sine = np.linalg.norm(axis)
    return axis * (np.arcsin(min(sine, 1.0)) / sine if sine > 1e-12 else 1.0)


def screw(pose: Pose) -> Array:
    """log of `pose` on SE(3): (u, theta), (6,); p = V(theta) u."""
    w = rotation_vector(pose.R)
    a = np.linalg.norm(w)
    W = skew(w)
    factor = 1 / 12 + a**2 / 720 if a < 1e-3 else (1 - a / 2 / np.tan(a / 2)) / a**2
    return np.concatenate([(np.eye(3) - W / 2 + factor * W @ W) @ pose.p, w])


@dataclass(frozen=True)
class Node:
    """A frame on the structure: Exudyn's node and body, and the pose at home."""

    index: int
    body: int
    home: Pose


@dataclass(frozen=True)
class Link:
    """One elastic element from `start` to `end`; `D` is its section stiffness (6,) and `length` in um."""

    start: Node
    end: Node
    length: float
    D: Array


@dataclass(frozen=True)
class Spring:
    """A 6 x 6 spring between two frames that coincide at home, order (u, theta)."""

    start: Node
    end: Node
    K: Array


@dataclass(frozen=True)
class Equilibrium:
    """State of a frame in equilibrium: Exudyn's `coordinates`, and where each node's six of them begin."""

    coordinates: Array
    first: dict[int, int]

    def pose(self, node: Node) -> Pose:
        """Pose of `node` in the deformed state."""
        k = self.first[node.index]
        u = self.coordinates[k : k + 6]
        return Pose(node.home.p + u[:3], _from_angles(_to_angles(node.home.R) + u[3:]))

    def moved(self, node: Node) -> tuple[Array, Array]:
        """Displacement (3,) [um] and rotation vector (3,) [rad] of `node` since home, global axes."""
        k = self.first[node.index]
        return self.coordinates[k : k + 3].copy(), rotation_vector(self.pose(node).R @ node.home.R.T)


class Frame:
    """Collects nodes, links, springs, joints and loads; `solve` finds the equilibrium."""

    def __init__(self) -> None:
        self._container = exu.SystemContainer()
        self._mbs = self._container.AddSystem()
        self._nodes: list[Node] = []
        self.links: list[Link] = []
        self.springs: list[Spring] = []
        self._loads: list[int] = []
        self._held: list[tuple[Node, list[int]]] = []
        self._ground = self._mbs.AddObject(eii.ObjectGround())
        self._origin = self._mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=self._ground_node(), coordinate=0))

    def _ground_node(self) -> int:
        return self._mbs.AddNode(eii.NodePointGround())

    def node(self, home: Pose) -> Node:
        """A free frame at `home`."""
        start = [*home.p.tolist(), *_to_angles(home.R).tolist()]
        index = self._mbs.AddNode(eii.NodeRigidBodyRxyz(referenceCoordinates=start))
        body = self._mbs.AddObject(eii.ObjectRigidBody(mass=1.0, inertia=[1.0, 1.0, 1.0, 0, 0, 0], nodeNumber=index))
        self._nodes.append(Node(int(index), int(body), home))
        return self._nodes[-1]

    @property
    def ground(self) -> Node:
        """The fixed frame at the origin."""
        return Node(-1, int(self._ground), Pose(np.zeros(3), np.eye(3)))

    def _marker(self, node: Node, at: Pose) -> int:
        """A marker on `node` at the global home pose `at`."""
        local = node.home.inverse() @ at
        H = np.eye(4)
        H[:3, :3], H[:3, 3] = local.R, local.p
        return self._mbs.AddMarker(eii.MarkerBodyRigid(bodyNumber=node.body, localHT=H))

    def fix(self, master: Node, slave: Node) -> None:
        """Tie `slave` rigidly to `master` in their home positions."""
        pair = [self._marker(master, slave.home), self._marker(slave, slave.home)]
        self._mbs.AddObject(eii.GenericJoint(markerNumbers=pair))

    def attach(self, master: Node, at: Pose) -> Node:
        """A new node at the global pose `at`, rigid on `master`."""
        slave = self.node(at)
        self.fix(master, slave)
        return slave

    def hold(self, node: Node) -> None:
        """Prescribe all six coordinates of `node`; `solve` takes the displacements."""
        constraints = []
        for k in range(6):
            marker = self._mbs.AddMarker(eii.MarkerNodeCoordinate(nodeNumber=node.index, coordinate=k))
            constraints.append(
                int(self._mbs.AddObject(eii.CoordinateConstraint(markerNumbers=[self._origin, marker], offset=0.0)))
            )
        self._held.append((node, constraints))

    def link(self, start: Node, end: Node, D: Array) -> Link:
        """One element of section stiffness `D` (6,) along local x of `start`."""
        length = float(np.linalg.norm(end.home.p - start.home.p))
        section = exu.BeamSection()
        section.stiffnessMatrix = np.diag(D)
        section.massPerLength, section.inertia = 1.0, np.eye(3)
        self._mbs.AddObject(
            eii.ObjectBeamGeometricallyExact(nodeNumbers=[start.index, end.index], length=length, sectionData=section)
        )
        self.links.append(Link(start, end, length, np.asarray(D, dtype=float)))
        return self.links[-1]

    def beam(self, start: Node, length: float, stiffness: tuple[float, float, float, float], n: int) -> list[Link]:
        """A straight beam along local x of `start`; `stiffness` = (EA, GJ, EI_y, EI_z) [N, N um^2]."""
        EA, GJ, EI_y, EI_z = stiffness
        step = length / n
        D = np.array([EA, 12 * EI_z / step**2, 12 * EI_y / step**2, GJ, EI_y, EI_z])
        links = []
        for _ in range(n):
            links.append(self.link(start, self.node(start.home.at(x=step)), D))
            start = links[-1].end
        return links

    def spring(self, start: Node, end: Node, K: Array) -> Spring:
        """A spring of stiffness `K` (6, 6), order (u, theta), at the home pose of `end`."""
        pair = [self._marker(start, end.home), self._marker(end, end.home)]
        self._mbs.AddObject(
            eii.RigidBodySpringDamper(markerNumbers=pair, stiffness=np.asarray(K), useIntrinsicFormulation=True)
        )
        self.springs.append(Spring(start, end, np.asarray(K, dtype=float)))
        return self.springs[-1]

    def load(self, node: Node, at: Pose, turns: bool = True) -> int:
        """A force at `at`, which turns with `node` or keeps its direction; returns the load's place in `solve(forces)`. Zero until then."""
        load = self._mbs.AddLoad(
            eii.Force(markerNumber=self._marker(node, at), loadVector=[0.0, 0.0, 0.0], bodyFixed=turns)
        )
        self._loads.append(int(load))
        return len(self._loads) - 1

    def assemble(self, tolerance: float = 1e-9) -> None:
        """Close the frame; after this only `solve`. Newton stops at a residual (2-norm) of `tolerance` [N, N um]."""
        self._mbs.Assemble()
        self._first = {node.index: int(self._mbs.GetNodeODE2Index(node.index)) for node in self._nodes}
        s = exu.SimulationSettings()
        s.staticSolver.numberOfLoadSteps = 1
        s.staticSolver.useLoadFactor = False
        s.staticSolver.verboseMode = 0
        s.staticSolver.newton.relativeTolerance = 1e-13
        s.staticSolver.newton.absoluteTolerance = tolerance
        s.staticSolver.newton.maxIterations = 30
        s.staticSolver.newton.numericalDifferentiation.jacobianConnectorDerivative = True
        s.linearSolver.solverType = exu.LinearSolverType.EigenSparse
        s.solution.file.write = False
        self.settings = s

    def solve(
        self, forces: Array | None = None, held: Array | None = None, start: Equilibrium | Array | None = None
    ) -> Equilibrium:
        """Equilibrium under `forces` (n_loads, 3) [N] and `held` displacements (n_held, 6) [um, rad].

        `start`: where Newton begins, an earlier equilibrium or coordinates; home if None.
        """
        data = self._mbs.systemData
        if start is None:
            data.SetODE2Coordinates(np.zeros(data.ODE2Size()), exu.ConfigurationType.Initial)
        else:
            q = start.coordinates if isinstance(start, Equilibrium) else start
            data.SetODE2Coordinates(q, exu.ConfigurationType.Initial)
        for load, force in zip(self._loads, [] if forces is None else forces, strict=forces is not None):
            self._mbs.SetLoadParameter(load, "loadVector", [float(f) for f in force])
        for (_, constraints), values in zip(self._held, [] if held is None else held, strict=held is not None):
            for constraint, value in zip(constraints, values, strict=True):
                self._mbs.SetObjectParameter(constraint, "offset", float(value))
        try:
            self._mbs.SolveStatic(self.settings)
        except exu.SolverError as failure:
            raise RuntimeError("no equilibrium found from this start; approach the load in smaller steps") from failure
        return Equilibrium(np.array(data.GetODE2Coordinates(exu.ConfigurationType.Current)), self._first)

    def strain(self, link: Link, state: Equilibrium) -> Array:
        """(eps, gamma_y, gamma_z, kappa_x, kappa_y, kappa_z) of `link`, (6,) [1, 1/um]."""
        e = screw(state.pose(link.start).inverse() @ state.pose(link.end)) / link.length
        e[0] -= 1
        return e

    def section_loads(self, link: Link, state: Equilibrium) -> Array:
        """(N, V_y, V_z, T, M_y, M_z) at the middle of `link`, (6,) [N, N um]."""
        return link.D * self.strain(link, state)

    def energy(self, state: Equilibrium) -> float:
        """Stored elastic energy [N um = uJ]."""
        total = 0.0
        for link in self.links:
            e = self.strain(link, state)
            total += link.length / 2 * float(e @ (link.D * e))
        for spring in self.springs:
            at = spring.end.home
            start = spring.start.home if spring.start.index < 0 else state.pose(spring.start)
            begin = start @ (spring.start.home.inverse() @ at)
            e = screw(begin.inverse() @ state.pose(spring.end))
            total += float(e @ spring.K @ e) / 2
        return total
