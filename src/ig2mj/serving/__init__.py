"""Policies over a network: a client of policy servers, and a server of ig2mj's policies.

The protocol is openpi's: a websocket, over which observations and actions go as msgpack with arrays of NumPy's.
"""

from __future__ import annotations
