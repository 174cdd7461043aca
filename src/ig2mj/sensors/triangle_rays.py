"""Rays against a tree of triangles (`ig2mj.sensors.triangle_trees`), in kernels of Warp.

Warp's own query of a mesh reads a triangle by way of its number, its corners' numbers and their places, and projects
them along the ray's largest axis, in double precision near edges. Here both children of a node are in 64 bytes, a
triangle is in 48, and a ray does two products with the triangle's map to know where it meets it.
"""

# Warp's types are made when they are used:
# pyright: reportInvalidTypeForm=false

from __future__ import annotations

import warp as wp

from ig2mj.sensors.triangle_trees import DEEPEST

Hit = wp.types.vector(length=7, dtype=float)
"""Distance (negative: nothing is met), the first two corners' shares of the point, the face's number, the unit normal
in the mesh's frame."""

_SNIPPET = f"""
#if defined(__CUDA_ARCH__)
    using Row = float4;
    const auto at = [](const Row* row) {{ return __ldg(row); }};
    const auto least = [](float a, float b) {{ return fminf(a, b); }};
    const auto most = [](float a, float b) {{ return fmaxf(a, b); }};
#else
    struct Row {{ float x, y, z, w; }};
    const auto at = [](const Row* row) {{ return *row; }};
    const auto least = [](float a, float b) {{ return a < b ? a : b; }};
    const auto most = [](float a, float b) {{ return a > b ? a : b; }};
#endif
    const auto word = [](float number) {{ int read; memcpy(&read, &number, sizeof(read)); return read; }};
    const auto sure = [](float d) {{ return d > 1e-18f || d < -1e-18f ? d : (d < 0.0f ? -1e-18f : 1e-18f); }};
    const Row* const rows = (const Row*)tree;
    const Row head = at(rows);
    const Row* const triangles = rows + word(head.x);
    const float ix = 1.0f / sure(direction[0]), iy = 1.0f / sure(direction[1]), iz = 1.0f / sure(direction[2]);
    const float ox = origin[0], oy = origin[1], oz = origin[2];
    float best = reach, best_u = 0.0f, best_v = 0.0f;
    int found = -1;
    int later[{DEEPEST}];
    float entries[{DEEPEST}];
    int left = 0;
    int node = word(head.z);
    while (node != 0) {{
        if (node > 0) {{
            const Row low0 = at(rows + node), high0 = at(rows + node + 1);
            const Row low1 = at(rows + node + 2), high1 = at(rows + node + 3);
            const float ax = (low0.x - ox) * ix, bx = (high0.x - ox) * ix;
            const float ay = (low0.y - oy) * iy, by = (high0.y - oy) * iy;
            const float az = (low0.z - oz) * iz, bz = (high0.z - oz) * iz;
            const float enter0 = most(most(least(ax, bx), least(ay, by)), most(least(az, bz), 0.0f));
            const float leave0 = least(least(most(ax, bx), most(ay, by)), least(most(az, bz), best));
            const float cx = (low1.x - ox) * ix, dx = (high1.x - ox) * ix;
            const float cy = (low1.y - oy) * iy, dy = (high1.y - oy) * iy;
            const float cz = (low1.z - oz) * iz, dz = (high1.z - oz) * iz;
            const float enter1 = most(most(least(cx, dx), least(cy, dy)), most(least(cz, dz), 0.0f));
            const float leave1 = least(least(most(cx, dx), most(cy, dy)), least(most(cz, dz), best));
            const bool into0 = enter0 <= leave0, into1 = enter1 <= leave1;
            if (into0 && into1) {{
                const bool first = enter0 <= enter1;
                later[left] = first ? word(low1.w) : word(low0.w);
                entries[left++] = first ? enter1 : enter0;
                node = first ? word(low0.w) : word(low1.w);
                continue;
            }}
            if (into0 || into1) {{
                node = into0 ? word(low0.w) : word(low1.w);
                continue;
            }}
        }} else {{
            const int begin = (-node) >> 3, end = begin + ((-node) & 7);
            for (int k = begin; k < end; ++k) {{
                const Row c = at(triangles + 3 * k + 2);
                const float height = c.x * ox + c.y * oy + c.z * oz + c.w;
                const float rise = c.x * direction[0] + c.y * direction[1] + c.z * direction[2];
                const float t = -height / rise;
                if (!(t >= 0.0f && t < best) || (culled && rise > 0.0f)) continue;
                const float px = ox + t * direction[0], py = oy + t * direction[1], pz = oz + t * direction[2];
                const Row a = at(triangles + 3 * k), b = at(triangles + 3 * k + 1);
                const float u = a.x * px + a.y * py + a.z * pz + a.w;
                const float v = b.x * px + b.y * py + b.z * pz + b.w;
                if (u >= 0.0f && v >= 0.0f && u + v <= 1.0f) {{
                    best = t;
                    best_u = u;
                    best_v = v;
                    found = k;
                }}
            }}
        }}
        node = 0;
        while (left > 0) {{
            if (entries[--left] < best) {{
                node = later[left];
                break;
            }}
        }}
    }}
    wp::vec_t<7, float> hit(-1.0f);
    if (found >= 0) {{
        const Row c = at(triangles + 3 * found + 2);
        const float size = 1.0f / wp::sqrt(c.x * c.x + c.y * c.y + c.z * c.z);
        hit[0] = best;
        hit[1] = 1.0f - best_u - best_v;
        hit[2] = best_u;
        hit[3] = (float)(((const int*)(rows + word(head.y)))[found]);
        hit[4] = c.x * size;
        hit[5] = c.y * size;
        hit[6] = c.z * size;
    }}
    return hit;
"""


@wp.func_native(_SNIPPET)
def first_triangle(tree: wp.uint64, origin: wp.vec3, direction: wp.vec3, reach: float, culled: bool) -> Hit:
    """What a ray meets first.

    Args:
      tree: address of the tree's rows. origin, direction: in the mesh's frame; the direction has length 1.
      reach: m; nothing behind it is met. culled: triangles seen from behind are not there.
    """
