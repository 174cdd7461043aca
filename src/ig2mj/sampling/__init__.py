"""From truth to state: perturbed and settled initial states, pools of them."""
