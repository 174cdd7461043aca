"""Learning: SAC, PPO, imitation, and what they share. Each algorithm is one file that reads from top to bottom.

    env = ig2mj.make("CookingMeat", worlds=2048, engine="warp")
    sac = SAC(Perception(env.observation_spaces, "state"), env.action_space.shape[0])
    result = train(env, sac, Run(minutes=5, out="runs/meat"))

| file | what |
|---|---|
| `perception` | what networks see of an environment's observations |
| `networks`, `moments`, `replay` | actors and critics; running means and scales; past steps on the device |
| `sac`, `ppo`, `bc`, `dagger` | the algorithms |
| `collect` | steps of an environment under a policy: one scan on a pure engine, a loop on the native one |
| `iteration` | a rollout and what is learned from it, on one device or on several |
| `solid` | trees of arrays as programs over several devices can take them |
| `train`, `checkpoints`, `log` | the loop around an algorithm; what survives a kill; CSV and TensorBoard |
| `labels`, `demos` | what should be done in a state; demonstrations as HDF5 |
| `guidance` | an expert that begins episodes and corrects an actor, ever less |
| `policies`, `shipped`, `evaluate` | policy files, those that ship with the project, and how good they are |
| `memory` | how many worlds fit into a device |
"""

from ig2mj.process.public_names import offer_modules

offer_modules(__name__)
