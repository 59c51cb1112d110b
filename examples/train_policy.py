"""Train a small policy by PPO on scenes of a family, and judge it on others: `pip install "vsconstraints[learn]"`.

The network adds to the command of a law (`--law ""` for none). Its weights are what `Policy(weights=...)` loads.
"""

import argparse
import time

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.env_util import make_vec_env

from vsconstraints.controllers import make_controller
from vsconstraints.learning import Policy
from vsconstraints.learning.environment import ServoEnv
from vsconstraints.scenarios.families import Family
from vsconstraints.simulation import score_run


class Until(BaseCallback):
    """Ends training after some seconds of one core."""

    def __init__(self, seconds):
        super().__init__()
        self.end = time.process_time() + seconds

    def _on_step(self):
        return time.process_time() < self.end


def save(model, path, law, acceleration):
    """Write the layers of the policy's network, whose last one gives the action."""
    net = model.policy
    linear = [layer for layer in [*net.mlp_extractor.policy_net, net.action_net] if isinstance(layer, torch.nn.Linear)]
    arrays = {}
    for i, layer in enumerate(linear):
        arrays[f"W{i}"], arrays[f"b{i}"] = (part.detach().numpy() for part in (layer.weight, layer.bias))
    np.savez_compressed(path, law=np.array(law), acceleration=np.array(acceleration), **arrays)


def judge(name, controller, setups):
    """Print how often a law arrives, and how often without a violation of any row by more than 1 % of its scale."""
    scores = [score_run(setup, controller) for setup in setups]
    arrived = np.array([score.status == "converged" for score in scores])
    worst = np.array([np.max(score.sigma_max) for score in scores])
    kept = arrived & (worst <= 0.01)
    print(f"{name:28} arrives in {arrived.mean():4.0%}, keeps every row besides in {kept.mean():4.0%} of {len(setups)}")


parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--out", default="policy.npz")
parser.add_argument("--family", default="planar-arm")
parser.add_argument("--law", default="tracking")
parser.add_argument("--acceleration", type=float, default=20.0)
parser.add_argument("--violation-weight", type=float, default=5.0)
parser.add_argument("--scenes", type=int, default=100)
parser.add_argument("--held-out", type=int, default=50)
parser.add_argument("--seconds", type=float, default=240.0)
parser.add_argument("--seed", type=int, default=0)
given = parser.parse_args()

torch.set_num_threads(1)
options = {"scenes": given.family, "count": given.scenes, "law": given.law or None}
options |= {"acceleration": given.acceleration, "violation_weight": given.violation_weight}
environments = make_vec_env(ServoEnv, n_envs=16, seed=given.seed, env_kwargs=options)
model = PPO(
    "MlpPolicy",
    environments,
    learning_rate=3e-4,
    n_steps=256,
    batch_size=512,
    n_epochs=5,
    gamma=0.998,
    gae_lambda=0.95,
    policy_kwargs={"net_arch": [64, 64], "log_std_init": -2.3 if given.law else -0.5},
    seed=given.seed,
    device="cpu",
    verbose=1,
)
model.learn(total_timesteps=10**9, callback=Until(given.seconds), log_interval=5)
save(model, given.out, given.law, given.acceleration)

family = Family.load(given.family)
setups = [family.scene(number, "held-out").setup() for number in range(given.held_out)]
if given.law:
    judge(given.law, make_controller(given.law), setups)
judge("policy", Policy(weights=given.out), setups)
judge("policy, filtered", Policy(weights=given.out, demand="barrier", resolver="filter"), setups)
