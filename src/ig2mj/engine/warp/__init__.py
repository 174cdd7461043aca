"""The engine on MJX-Warp: thousands of worlds on a GPU; its buffers, and the patches of MuJoCo Warp."""
