"""What is dropped on a floor that is deep and gives way for longer neither falls through nor is thrown."""

from __future__ import annotations

import drops
import numpy as np

import ig2mj


def test_other_floors_have_the_same_surface():
    scene = ig2mj.load_scene("small_home")
    floors = drops.floors_of(scene)
    model = drops.with_floors(scene, 1.0, 0.04)
    top = [m.geom_pos[floors, 2] + m.geom_size[floors, 2] for m in (scene.model, model)]
    assert len(floors) == 3 and np.allclose(top, 0.0, atol=1e-12)
    assert np.allclose(model.geom_size[floors, 2], 0.5) and np.allclose(model.geom_solref[floors, 0], 0.04)
    others = np.setdiff1d(np.arange(model.ngeom), floors)
    assert (model.geom_size[others] == scene.model.geom_size[others]).all()
    assert (model.geom_solref[others] == scene.model.geom_solref[others]).all()


def test_things_are_dropped_where_the_floor_is_free():
    scene = ig2mj.load_scene("small_home")
    place = drops.free_place(scene)
    data = scene.start_data()
    near = np.linalg.norm(data.xipos[:, :2] - place, axis=1) < drops.ROOM / 2
    assert scene.rooms is not None and scene.rooms.room_at(place) is not None
    assert not (near & (data.xipos[:, 2] > 0.05) & (data.xipos[:, 2] < 1.5)).any()


def test_a_piece_of_cheese_falls_through_thin_floors_and_not_through_deep_ones():
    thin = drops.run(drops.Args(drops=20, depth=0.2, time_constant=0.02), "cheese")
    deep = drops.run(drops.Args(drops=20, depth=1.0, time_constant=0.04), "cheese")
    assert thin["lost"] > 0 and thin["floor_m"] == 0.2
    assert deep["lost"] == 0 and deep["fastest_m_s"] < 6.5 and deep["floor_m"] == 1.0
