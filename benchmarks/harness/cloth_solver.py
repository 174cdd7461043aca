"""Cloth by position-based dynamics (XPBD) in many worlds, one block of threads per cloth.

A control step is 1/30 s: `SUBSTEPS` substeps of one pass over all constraints each (small-step XPBD, Macklin et al.
2019), contacts with convex pieces, friction and thickness. Nothing of ig2mj is used.

Frames and units: world frame, m, s, kg. Positions and velocities are `[W, V]` vectors. A convex piece is a sphere or an
intersection of half-spaces, with a pose `[W, K]` in each world.
"""

# Warp's kernels are not Python, so nothing may check them:
# pyright: reportIndexIssue=false, reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportOperatorIssue=false, reportInvalidTypeForm=false, reportGeneralTypeIssues=false
# pyright: reportReturnType=false, reportAssignmentType=false

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp

CONTROL_STEP = 1 / 30
SUBSTEPS = 10
GRAVITY = -9.81
THREADS = 128

SIZE, DENSITY, THICKNESS = 0.5, 0.3, 0.008
"""Edge length in m, mass per area in kg/m2, and the least distance of two vertices and of a vertex to a surface times
two, m."""

FRICTION = 0.4
DAMPING = 0.3
"""Share of the velocity lost to air per second."""

SHEAR, BENDING = 5e-3, 5e-6
"""Compliance of shear edges, m/N, and bending stiffness per width, N m: those of cotton."""

MOST_PIECES, MOST_NEIGHBOURS = 16, 8


@dataclasses.dataclass(frozen=True)
class Cloth:
    """A rectangular sheet in its rest state.

    Attributes:
      vertices: `[V, 3]`, m, in the xy plane. mass: `[V]`, kg.
      elements: `[E, 4]` vertex indices (a, b, c) and 0 for a distance (c is -1) or 1 for bending about b.
      rest: `[E]`, m: length of a distance. compliance: `[E]`, m/N.
      colours: `[C + 1]`: elements of colour c are `colours[c]:colours[c + 1]`; no two of them share a vertex.
      grid: rows and columns.
    """

    vertices: np.ndarray
    mass: np.ndarray
    elements: np.ndarray
    rest: np.ndarray
    compliance: np.ndarray
    colours: np.ndarray
    grid: tuple[int, int]


def make_cloth(
    rows: int,
    columns: int,
    width: float = SIZE,
    height: float = SIZE,
    density: float = DENSITY,
    stretch: float = 0.0,
    shear: float | None = SHEAR,
    bending: float | None = BENDING,
) -> Cloth:
    """A sheet of `rows` x `columns` vertices. None: no such elements.

    `stretch`, `shear`: compliance of an edge, m/N. `bending`: stiffness per width, N m. The energy of a bending element
    is |a - 2 b + c|^2 / 2k, which is gap^4 curvature^2 / 2k, so that its compliance k is gap^3 / (stiffness x breadth).
    """
    x, y = np.meshgrid(np.linspace(0, width, columns), np.linspace(0, height, rows))
    vertices = np.stack([x.ravel(), y.ravel(), np.zeros(rows * columns)], 1)
    share_x, share_y = np.ones(columns), np.ones(rows)
    if columns > 1:
        share_x[[0, -1]] = 0.5
    if rows > 1:
        share_y[[0, -1]] = 0.5
    share = np.outer(share_y, share_x).ravel()
    mass = density * width * height * share / share.sum()

    def index(row: int, column: int) -> int:
        return row * columns + column

    groups: list[list[tuple[int, int, int, int]]] = []
    compliances: list[float] = []

    def add(step: tuple[int, int], of: Callable[[int, int], int], number: int, compliance: float, kind: int) -> None:
        """Elements from each vertex along a step of the grid, in `number` colours."""
        for colour in range(number):
            group = []
            for row in range(rows):
                for column in range(columns):
                    ends = [(row + k * step[0], column + k * step[1]) for k in range(3 if kind else 2)]
                    if of(row, column) % number == colour and all(0 <= r < rows and 0 <= c < columns for r, c in ends):
                        where = [index(*end) for end in ends]
                        group.append((where[0], where[1], where[2] if kind else -1, kind))
            if group:
                groups.append(group)
                compliances.extend([compliance] * len(group))

    add((0, 1), lambda r, c: c, 2, stretch, 0)
    add((1, 0), lambda r, c: r, 2, stretch, 0)
    if shear is not None:
        add((1, 1), lambda r, c: r, 2, shear, 0)
        add((1, -1), lambda r, c: r, 2, shear, 0)
    if bending is not None:
        gap_x, gap_y = width / max(columns - 1, 1), height / max(rows - 1, 1)
        add((0, 1), lambda r, c: c, 3, gap_x**3 / (bending * height / rows), 1)
        add((1, 0), lambda r, c: r, 3, gap_y**3 / (bending * width / columns), 1)
    elements = np.array([element for group in groups for element in group], np.int32)
    rest = np.linalg.norm(vertices[elements[:, 0]] - vertices[elements[:, 1]], axis=1)
    colours = np.cumsum([0, *map(len, groups)]).astype(np.int32)
    return Cloth(vertices, mass, elements, rest, np.array(compliances), colours, (rows, columns))


@dataclasses.dataclass(frozen=True)
class Piece:
    """A convex piece in its own frame: a sphere of `radius`, or half-spaces `[P, 4]` with normal · p <= offset."""

    planes: np.ndarray
    radius: float
    reach: float
    """m: nothing of it is farther from its frame's origin."""


def sphere(radius: float) -> Piece:
    return Piece(np.zeros((0, 4)), radius, radius)


def box(half: tuple[float, float, float]) -> Piece:
    normals = np.concatenate([np.eye(3), -np.eye(3)])
    return Piece(np.column_stack([normals, np.tile(half, 2)]), 0.0, float(np.linalg.norm(half)))


def prism(radius: float, half_height: float, sides: int) -> Piece:
    """A standing prism around a cylinder, as a converted mug has it."""
    angles = 2 * np.pi * np.arange(sides) / sides
    around = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(sides), np.full(sides, radius)])
    ends = np.array([[0, 0, 1, half_height], [0, 0, -1, half_height]])
    reach = float(np.hypot(radius / np.cos(np.pi / sides), half_height))
    return Piece(np.concatenate([around, ends]), 0.0, reach)


SOURCE = """
#if defined(__CUDA_ARCH__)
#define SHARED __shared__
#define SYNC() __syncthreads()
const int tid = threadIdx.x, width = blockDim.x;
#define ADD(where, what) atomicAdd(&(where), (what))
#else
#define SHARED
#define SYNC()
const int tid = 0, width = 1;
#define ADD(where, what) (where) += (what)
#endif
SHARED float x[3 * NV], p[3 * NV], v[3 * NV], w[NV];
SHARED float bounds[6], partial[6 * NT], impulse[6 * NK];
SHARED int near_pieces[NK], num_near, touching;
const int base = world * NV;
for (int i = tid; i < NV; i += width) {
  for (int k = 0; k < 3; ++k) { x[3*i+k] = pos.data[base + i].c[k]; v[3*i+k] = vel.data[base + i].c[k]; }
  w[i] = inverse_mass.data[i];
}
for (int k = tid; k < 6 * NK; k += width) impulse[k] = 0.0f;
if (tid == 0) touching = 0;
SYNC();
const float h = dt / NS;
// pieces that the cloth may meet in this control step: spheres around them against its box
float low[3] = {1e9f, 1e9f, 1e9f}, high[3] = {-1e9f, -1e9f, -1e9f};
float fastest = 0.0f;
for (int i = tid; i < NV; i += width)
  for (int k = 0; k < 3; ++k) {
    low[k] = wp::min(low[k], x[3*i+k]); high[k] = wp::max(high[k], x[3*i+k]);
    fastest = wp::max(fastest, wp::abs(v[3*i+k]));
  }
for (int k = 0; k < 3; ++k) { partial[6*tid+k] = low[k] - fastest * dt; partial[6*tid+3+k] = high[k] + fastest * dt; }
SYNC();
for (int k = tid; k < 6; k += width) {
  float best = partial[k];
  for (int t = 1; t < width; ++t) best = k < 3 ? wp::min(best, partial[6*t+k]) : wp::max(best, partial[6*t+k]);
  bounds[k] = best;
}
SYNC();
if (tid == 0) {
  num_near = 0;
  for (int k = 0; k < num_pieces; ++k) {
    const float margin = piece_reach.data[k] + thickness + 0.5f * 9.81f * dt * dt;
    bool meets = true;
    for (int a = 0; a < 3; ++a) {
      const float at = piece_pos.data[world * num_pieces + k].c[a];
      meets = meets && at + margin > bounds[a] && at - margin < bounds[3 + a];
    }
    if (meets && num_near < NK) near_pieces[num_near++] = k;
  }
}
// vertices that may come closer than the thickness: found once a control step
int neighbours[NN * PT], count[PT];
const float near = thickness + wp::min(0.5f * thickness + 2.0f * fastest * dt, 2.0f * thickness);
if (USE_THICKNESS) {
  for (int slot = 0; slot < PT; ++slot) {
    const int i = tid + slot * width;
    count[slot] = 0;
    if (i >= NV) continue;
    const int row = i / columns, column = i % columns;
    for (int j = 0; j < NV; ++j) {
      const int dr = j / columns - row, dc = j % columns - column;
      if (dr <= 1 && dr >= -1 && dc <= 1 && dc >= -1) continue;
      const float a = x[3*i]-x[3*j], b = x[3*i+1]-x[3*j+1], c = x[3*i+2]-x[3*j+2];
      if (a*a + b*b + c*c < near*near && count[slot] < NN) neighbours[slot*NN + count[slot]++] = j;
    }
  }
}
SYNC();
for (int s = 0; s < NS; ++s) {
  for (int i = tid; i < NV; i += width) {
    const float keep = 1.0f - damping * h;
    for (int k = 0; k < 3; ++k) {
      p[3*i+k] = x[3*i+k];
      if (w[i] > 0.0f) {
        v[3*i+k] = keep * (v[3*i+k] + (k == 2 ? h * gravity : 0.0f));
        x[3*i+k] += h * v[3*i+k];
      }
    }
  }
  SYNC();
  for (int c = 0; c < NC; ++c) {
    for (int e = colours.data[c] + tid; e < colours.data[c + 1]; e += width) {
      const int a = elements.data[e].c[0], b = elements.data[e].c[1], d = elements.data[e].c[2];
      const float soft = compliance.data[e] / (h * h);
      if (d < 0) {
        const float total = w[a] + w[b];
        if (total == 0.0f) continue;
        const float dx = x[3*a]-x[3*b], dy = x[3*a+1]-x[3*b+1], dz = x[3*a+2]-x[3*b+2];
        const float length = wp::sqrt(dx*dx + dy*dy + dz*dz) + 1e-12f;
        const float push = -(length - rest.data[e]) / ((total + soft) * length);
        x[3*a] += w[a]*push*dx; x[3*a+1] += w[a]*push*dy; x[3*a+2] += w[a]*push*dz;
        x[3*b] -= w[b]*push*dx; x[3*b+1] -= w[b]*push*dy; x[3*b+2] -= w[b]*push*dz;
      } else {
        const float total = w[a] + w[d] + 4.0f * w[b];
        if (total == 0.0f) continue;
        for (int k = 0; k < 3; ++k) {
          const float push = -(x[3*a+k] + x[3*d+k] - 2.0f*x[3*b+k]) / (total + soft);
          x[3*a+k] += w[a]*push; x[3*d+k] += w[d]*push; x[3*b+k] -= 2.0f*w[b]*push;
        }
      }
    }
    SYNC();
  }
  if (USE_THICKNESS) {
    float moved[3 * PT];
    for (int slot = 0; slot < PT; ++slot) {
      const int i = tid + slot * width;
      for (int k = 0; k < 3; ++k) moved[3*slot+k] = 0.0f;
      if (i >= NV) continue;
      for (int n = 0; n < count[slot]; ++n) {
        const int j = neighbours[slot*NN + n];
        const float dx = x[3*i]-x[3*j], dy = x[3*i+1]-x[3*j+1], dz = x[3*i+2]-x[3*j+2];
        const float distance = wp::sqrt(dx*dx + dy*dy + dz*dz) + 1e-12f;
        const float share = w[i] + w[j] > 0.0f ? w[i] / (w[i] + w[j]) : 0.0f;
        if (distance < thickness) {
          const float push = 0.5f * share * (thickness - distance) / distance;
          moved[3*slot] += push*dx; moved[3*slot+1] += push*dy; moved[3*slot+2] += push*dz;
        }
      }
    }
    SYNC();
    for (int slot = 0; slot < PT; ++slot) {
      const int i = tid + slot * width;
      if (i < NV) for (int k = 0; k < 3; ++k) x[3*i+k] += moved[3*slot+k];
    }
    SYNC();
  }
  for (int i = tid; i < NV; i += width) {
    if (w[i] == 0.0f) continue;
    for (int n = 0; n < num_near; ++n) {
      const int k = near_pieces[n];
      const wp::vec_t<3, float> at = piece_pos.data[world * num_pieces + k];
      const wp::quat_t<float> turn = piece_quat.data[world * num_pieces + k];
      const wp::vec_t<3, float> apart(x[3*i]-at.c[0], x[3*i+1]-at.c[1], x[3*i+2]-at.c[2]);
      float depth; wp::vec_t<3, float> normal;
      const float radius = piece_radius.data[k];
      if (radius > 0.0f) {
        const float distance = wp::length(apart) + 1e-12f;
        depth = radius + 0.5f*thickness - distance;
        normal = wp::div(apart, distance);
      } else {
        const wp::vec_t<3, float> local = wp::quat_rotate_inv(turn, apart);
        float most = -1e9f; int which = 0;
        for (int q = piece_start.data[k]; q < piece_start.data[k + 1]; ++q) {
          const wp::vec_t<4, float> plane = planes.data[q];
          const float over = plane.c[0]*local.c[0] + plane.c[1]*local.c[1] + plane.c[2]*local.c[2] - plane.c[3];
          if (over > most) { most = over; which = q; }
          if (over > 0.5f*thickness) break;
        }
        depth = 0.5f*thickness - most;
        const wp::vec_t<4, float> plane = planes.data[which];
        normal = wp::quat_rotate(turn, wp::vec_t<3, float>(plane.c[0], plane.c[1], plane.c[2]));
      }
      if (depth <= 0.0f) continue;
      const wp::vec_t<3, float> speed = piece_vel.data[world * num_pieces + k];
      float moved[3], tangent[3], along = 0.0f;
      for (int a = 0; a < 3; ++a) moved[a] = x[3*i+a] - p[3*i+a] - h * speed.c[a];
      for (int a = 0; a < 3; ++a) along += moved[a] * normal.c[a];
      float slip = 0.0f;
      for (int a = 0; a < 3; ++a) { tangent[a] = moved[a] - along * normal.c[a]; slip += tangent[a]*tangent[a]; }
      slip = wp::sqrt(slip) + 1e-12f;
      const float held = wp::min(1.0f, friction * depth / slip);
      float kick[3];
      for (int a = 0; a < 3; ++a) {
        const float change = depth * normal.c[a] - held * tangent[a];
        x[3*i+a] += change;
        kick[a] = -change / (w[i] * h);
      }
      if (s == NS - 1) ADD(touching, 1);
      for (int a = 0; a < 3; ++a) ADD(impulse[6*n+a], kick[a]);
      ADD(impulse[6*n+3], apart.c[1]*kick[2] - apart.c[2]*kick[1]);
      ADD(impulse[6*n+4], apart.c[2]*kick[0] - apart.c[0]*kick[2]);
      ADD(impulse[6*n+5], apart.c[0]*kick[1] - apart.c[1]*kick[0]);
    }
  }
  SYNC();
  for (int i = tid; i < NV; i += width)
    for (int k = 0; k < 3; ++k) v[3*i+k] = (x[3*i+k] - p[3*i+k]) / h;
  SYNC();
}
for (int i = tid; i < NV; i += width)
  for (int k = 0; k < 3; ++k) { pos.data[base + i].c[k] = x[3*i+k]; vel.data[base + i].c[k] = v[3*i+k]; }
for (int n = tid; n < num_pieces; n += width)
  for (int a = 0; a < 6; ++a) piece_impulse.data[6 * (world * num_pieces + n) + a] = 0.0f;
SYNC();
for (int n = tid; n < num_near; n += width)
  for (int a = 0; a < 6; ++a) piece_impulse.data[6 * (world * num_pieces + near_pieces[n]) + a] = impulse[6*n+a];
if (tid == 0) touches.data[world] = touching;
"""


@functools.cache
def kernel_of(vertices: int, colours: int, thickness: bool, substeps: int, cpu: bool = False) -> wp.Kernel:
    """The kernel of a control step of cloths with so many vertices and colours of elements."""
    threads = 1 if cpu else THREADS
    numbers = {"NV": vertices, "NS": substeps, "NC": colours, "NK": MOST_PIECES, "NN": MOST_NEIGHBOURS,
               "NT": threads, "PT": -(-vertices // threads), "USE_THICKNESS": int(thickness)}  # fmt: skip
    defines = "".join(f"const int {name} = {value};\n" for name, value in numbers.items())

    @wp.func_native(snippet=defines + SOURCE)
    def step_cloth(
        world: int,
        pos: wp.array(dtype=wp.vec3),
        vel: wp.array(dtype=wp.vec3),
        inverse_mass: wp.array(dtype=float),
        elements: wp.array(dtype=wp.vec4i),
        rest: wp.array(dtype=float),
        compliance: wp.array(dtype=float),
        colours: wp.array(dtype=int),
        columns: int,
        num_pieces: int,
        planes: wp.array(dtype=wp.vec4),
        piece_start: wp.array(dtype=int),
        piece_radius: wp.array(dtype=float),
        piece_reach: wp.array(dtype=float),
        piece_pos: wp.array(dtype=wp.vec3),
        piece_quat: wp.array(dtype=wp.quat),
        piece_vel: wp.array(dtype=wp.vec3),
        dt: float,
        gravity: float,
        damping: float,
        friction: float,
        thickness: float,
        piece_impulse: wp.array(dtype=float),
        touches: wp.array(dtype=int),
    ): ...

    @wp.kernel(module="unique", enable_backward=False)
    def control_step(
        pos: wp.array(dtype=wp.vec3),
        vel: wp.array(dtype=wp.vec3),
        inverse_mass: wp.array(dtype=float),
        elements: wp.array(dtype=wp.vec4i),
        rest: wp.array(dtype=float),
        compliance: wp.array(dtype=float),
        colours: wp.array(dtype=int),
        columns: int,
        num_pieces: int,
        planes: wp.array(dtype=wp.vec4),
        piece_start: wp.array(dtype=int),
        piece_radius: wp.array(dtype=float),
        piece_reach: wp.array(dtype=float),
        piece_pos: wp.array(dtype=wp.vec3),
        piece_quat: wp.array(dtype=wp.quat),
        piece_vel: wp.array(dtype=wp.vec3),
        dt: float,
        gravity: float,
        damping: float,
        friction: float,
        thickness: float,
        piece_impulse: wp.array(dtype=float),
        touches: wp.array(dtype=int),
    ):
        world, _thread = wp.tid()
        step_cloth(
            world, pos, vel, inverse_mass, elements, rest, compliance, colours, columns, num_pieces, planes,
            piece_start,
            piece_radius, piece_reach, piece_pos, piece_quat, piece_vel, dt, gravity, damping, friction, thickness,
            piece_impulse, touches,
        )  # fmt: skip

    return control_step


@wp.kernel(enable_backward=False)
def push_bodies(
    piece_impulse: wp.array(dtype=float),
    piece_body: wp.array(dtype=int),
    piece_offset: wp.array(dtype=wp.vec3),
    num_pieces: int,
    seconds: float,
    most: float,
    force: wp.array2d(dtype=wp.spatial_vector),
):
    """The coupling: each piece's impulse as a force and torque on its body during the next physics step.

    `most`: limit of the force in N. A body below 0 is welded to the world: nothing is written.
    """
    world, piece = wp.tid()
    body = piece_body[piece]
    if body < 0:
        return
    at = 6 * (world * num_pieces + piece)
    linear = wp.vec3(piece_impulse[at], piece_impulse[at + 1], piece_impulse[at + 2]) / seconds
    angular = wp.vec3(piece_impulse[at + 3], piece_impulse[at + 4], piece_impulse[at + 5]) / seconds
    scale = wp.min(1.0, most / (wp.length(linear) + 1.0e-9))
    linear = linear * scale
    angular = angular * scale + wp.cross(piece_offset[piece], linear)
    wp.atomic_add(force, world, body, wp.spatial_vector(linear, angular))


class Sheets:
    """The same cloth in many worlds.

    Attributes:
      pos, vel: `[W * V]` vectors. piece_pos, piece_vel, piece_quat: `[W * K]`. piece_impulse: `[W * K * 6]`, N s and
      N m s about the piece's origin, of the last control step. touches: `[W]` vertices in contact.
    """

    def __init__(
        self,
        cloth: Cloth,
        start: np.ndarray,
        pieces: list[tuple[Piece, np.ndarray]],
        pinned: np.ndarray | None = None,
        gravity: float = GRAVITY,
        friction: float = FRICTION,
        damping: float = DAMPING,
        thickness: float = THICKNESS,
        use_contacts: bool = True,
        substeps: int = SUBSTEPS,
        device: str | None = None,
    ):
        """`start`: `[W, V, 3]`. `pieces`: each with its positions `[W, 3]`. `pinned`: indices of vertices that stay."""
        self.device = wp.get_device(device)
        self.cloth, self.num_worlds, self.num_pieces = cloth, len(start), len(pieces) if use_contacts else 0
        shapes = [piece for piece, _ in pieces][: self.num_pieces]
        inverse = 1.0 / cloth.mass
        if pinned is not None:
            inverse[pinned] = 0.0

        def array(values: Any, dtype: Any) -> wp.array:
            return wp.array(np.ascontiguousarray(values), dtype=dtype, device=self.device)

        places = np.stack([at for _, at in pieces][: self.num_pieces], 1) if self.num_pieces else np.zeros((1, 1, 3))
        counts = [len(shape.planes) for shape in shapes]
        planes = np.concatenate([np.zeros((1, 4)), *(shape.planes for shape in shapes)])[1 if any(counts) else 0 :]
        self.pos = array(start.reshape(-1, 3), wp.vec3)
        self.vel = wp.zeros_like(self.pos)
        self.piece_pos = array(places.reshape(-1, 3), wp.vec3)
        self.piece_quat = array(np.tile([0.0, 0.0, 0.0, 1.0], (max(places.shape[0] * places.shape[1], 1), 1)), wp.quat)
        self.piece_vel = wp.zeros_like(self.piece_pos)
        self.piece_impulse = wp.zeros(max(self.num_worlds * self.num_pieces * 6, 1), dtype=float, device=self.device)
        self.touches = wp.zeros(self.num_worlds, dtype=int, device=self.device)
        thick = thickness > 0
        self._kernel = kernel_of(len(cloth.vertices), len(cloth.colours) - 1, thick, substeps, self.device.is_cpu)
        self._inputs = [
            self.pos, self.vel, array(inverse, float), array(cloth.elements, wp.vec4i), array(cloth.rest, float),
            array(cloth.compliance, float), array(cloth.colours, int), cloth.grid[1], self.num_pieces,
            array(planes, wp.vec4), array(np.cumsum([0, *counts]), int),
            array([s.radius for s in shapes] or [0.0], float), array([s.reach for s in shapes] or [0.0], float),
            self.piece_pos, self.piece_quat, self.piece_vel, CONTROL_STEP, gravity, damping, friction, thickness,
            self.piece_impulse, self.touches,
        ]  # fmt: skip

    def step(self) -> None:
        """A control step of all worlds."""
        block = 1 if self.device.is_cpu else THREADS
        wp.launch_tiled(self._kernel, dim=self.num_worlds, inputs=self._inputs, block_dim=block, device=self.device)

    @property
    def positions(self) -> np.ndarray:
        """`[W, V, 3]`, m."""
        return self.pos.numpy().reshape(self.num_worlds, -1, 3)

    @property
    def kinetic_energy(self) -> np.ndarray:
        """`[W]`, J."""
        speed = self.vel.numpy().reshape(self.num_worlds, -1, 3)
        return 0.5 * (self.cloth.mass * (speed**2).sum(-1)).sum(-1)

    @property
    def potential_energy(self) -> np.ndarray:
        """`[W]`, J, of gravity."""
        return -GRAVITY * (self.cloth.mass * self.positions[..., 2]).sum(-1)

    def bytes_per_world(self) -> float:
        """Device memory of all that a world has of its own."""
        own = (self.pos, self.vel, self.piece_pos, self.piece_quat, self.piece_vel, self.piece_impulse, self.touches)
        return sum(each.capacity for each in own) / self.num_worlds
