"""Sixteen boxes, wedges, capsules and cylinders that fall onto a board and each other."""

SHAPES = (
    'type="box" size="0.05 0.04 0.03"',
    'type="mesh" mesh="wedge"',
    'type="capsule" size="0.03 0.05"',
    'type="cylinder" size="0.04 0.03"',
)
BODIES = "".join(
    f'<body pos="{0.07 * (k % 4)} {0.07 * (k // 4 % 2)} {0.05 + 0.07 * (k // 8)}" euler="{20 * k} {35 * k} 0">'
    f'<freejoint/><geom {SHAPES[(k + k // 4) % 4]} gap="0.003"/></body>'
    for k in range(16)
)
SCENE = f"""<mujoco><option timestep="0.00833333" integrator="implicitfast"><flag sleep="enable"/></option>
<asset><mesh name="wedge" vertex="-.05 -.04 -.03 .05 -.04 -.03 -.05 .04 -.03 .05 .04 -.03 -.05 0 .04 .05 0 .04"/>
</asset>
<worldbody><geom type="box" size="1 1 0.05" pos="0 0 -0.05"/>{BODIES}</worldbody></mujoco>"""
