"""Pure functions on poses, rays, boxes, convex pieces and cameras. JAX arrays, batch axes first, no MuJoCo.

poses     quaternions w,x,y,z; compose, invert, transform
rays      where rays enter convex pieces (entry hits only, all of them)
targets   the same for chosen pairs of objects, laid out ahead: what on_top, under, inside and next_to ask
boxes     axis-aligned boxes: the tight rule and iGibson's, gaps
hulls     depth of points in convex pieces, support of their cores
gjk       distance and nearest points of pieces of any kind
frustum   which points a camera may see
surface   even samples of pieces' surfaces
"""
