"""Learning: SAC, PPO, imitation, and what they share. Each algorithm is one file that reads from top to bottom.

    env = ig2mj.make("CookingMeat", worlds=2048, engine="warp")
    sac = SAC(Perception(env.observation_spaces, "state"), env.action_space.shape[0])
    result = train(env, sac, Run(minutes=5, out="runs/meat"))

| file | what |
|---|---|
| `algorithms` | settings by name, and how an algorithm's parts are put together |
| `sac`, `ppo`, `bc`, `dagger` | the algorithms |
| `protocols` | an encoder, a memory, an adviser: what algorithms may be extended by |
| `networks`, `convolution`, `action_distributions` | actors and critics |
| `perception`, `privileged_targets` | what networks see of observations, and what they predict |
| `running_stats`, `adam` | means and scales; the optimizer |
| `replay`, `imitation_buffer`, `imitation` | buffers on the device; an actor that learns labels |
| `guidance` | an expert that begins episodes and labels states, with a share that is annealed to zero |
| `collect`, `train` | steps under a policy; the loop |
| `iteration`, `several_devices` | a rollout and the updates on it, on one device and on several |
| `checkpoints`, `log`, `progress`, `best` | what survives a kill; reports; which policy is kept |
| `settings`, `run_config` | settings by name; a run as a TOML file |
| `policies`, `policy_checks`, `shipped`, `evaluate`, `warm_start` | policy files, those that ship, how good they are |
| `device_memory`, `nonempty_leaves` | how many worlds fit; trees for programs over several devices |
| `demos` | demonstrations as networks see them |
| `occlusion` | objects that hands and arms hide; no algorithm imports it |
"""

from ig2mj.process.public_names import offer_modules

offer_modules(__name__)
