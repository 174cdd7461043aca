"""Learning to manipulate what hands and arms hide: an encoder, a memory and an adviser behind `ig2mj.learn.protocols`.

| file | what |
|---|---|
| `glimpses` | an encoder that looks at each object at full resolution |
| `object_memory` | how objects lay at first, and how a hand carries them |
| `belief_labels` | an expert's labels for where the actor believes objects to be |
| `encoder_pretraining` | an encoder learns from images of start states before the first step |
| `projection` | rows and columns of objects in the image, as targets of the encoder |

Three of the policies that ship use it. No algorithm imports it: `ig2mj.learn.algorithms` and `ig2mj.learn.policies` put
the parts together.
"""

from __future__ import annotations

import dataclasses

from ig2mj.process.public_names import offer_modules

offer_modules(__name__)

MEMORIES = ("none", "poses", "full")


@dataclasses.dataclass(frozen=True)
class OcclusionConfig:
    """Settings of DAgger under occlusion.

    Attributes:
      object_memory: "poses": the actor remembers objects' first poses and carries them with the hand that took them;
        "full": it also sees what it felt and predicted at the last grasp; "none". For the encoder `glimpses`.
      belief_labels: the expert's labels are for where such an actor believes objects to be.
      pretrain_images: of start states, from which the prediction learns: half as many samples again in each update.
      pretrain_updates: of the prediction on those before the first step.
      pretrain_expert_steps: so many first steps of each such episode are the expert's, and every seventh is pictured.
    """

    object_memory: str = "none"
    belief_labels: bool = False
    pretrain_images: int = 0
    pretrain_updates: int = 0
    pretrain_expert_steps: int = 0
