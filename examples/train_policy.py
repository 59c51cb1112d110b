"""Train a small policy on scenes of a family, and judge it on others: `pip install
"vsconstraints[learn]"`.

The network adds to the command of a law. It imitates a teacher first, in the states that it comes
to by itself (DAgger: Ross, Gordon and Bagnell, AISTATS 2011), and is then trained by PPO, if that
makes it better on the scenes it learns from. `Policy(weights=...)` loads what is written. Scenes of
the other half, which judge it, are not used before.
"""

import argparse
import time

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.env_util import make_vec_env

from vsconstraints.bench.families import Family
from vsconstraints.bench.learning import Policy
from vsconstraints.bench.learning.environment import ServoEnv
from vsconstraints.controllers import make_controller
from vsconstraints.simulation import score_run

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--out", default="policy.npz")
parser.add_argument("--family", default="planar-arm")
parser.add_argument("--law", default="tracking", help="what the network adds to")
parser.add_argument("--teacher", default="hierarchical-qp")
parser.add_argument(
    "--acceleration", type=float, default=10.0, help="the most that it adds [rad/s²]"
)
parser.add_argument("--violation-weight", type=float, default=3.0)
parser.add_argument("--scenes", type=int, default=300)
parser.add_argument("--held-out", type=int, default=50)
parser.add_argument("--imitation", type=float, default=180.0, help="seconds of one core")
parser.add_argument("--ppo", type=float, default=40.0, help="seconds of one core")
parser.add_argument("--seed", type=int, default=0)
given = parser.parse_args()


class Until(BaseCallback):
    """Ends training after some seconds of one core."""

    def _on_training_start(self):
        self.end = time.process_time() + given.ppo

    def _on_step(self):
        return time.process_time() < self.end


def episode(env, scene, act):
    """The return of an episode of a scene, and whether it arrived."""
    observation, info = env.reset(options={"scene": scene})
    total = 0.0
    done = False
    while not done:
        observation, reward, terminated, truncated, info = env.step(act(observation))
        total = total + reward
        done = terminated or truncated
    return total, info["success"]


def layers(policy):
    """The layers of the network, whose last one gives the action."""
    return [
        layer
        for layer in [*policy.mlp_extractor.policy_net, policy.action_net]
        if hasattr(layer, "weight")
    ]


def save(policy):
    """Write the network."""
    arrays = {"law": np.array(given.law), "acceleration": np.array(given.acceleration)}
    for i, layer in enumerate(layers(policy)):
        arrays[f"W{i}"], arrays[f"b{i}"] = (
            layer.weight.detach().numpy(),
            layer.bias.detach().numpy(),
        )
    np.savez_compressed(given.out, **arrays)
    return Policy(weights=given.out)


def imitate(policy, env):
    """Fit the network to what the teacher adds to the law, in the teacher's states at first, then
    in its own.
    """
    teacher = make_controller(given.teacher)
    law = make_controller(given.law)
    random = np.random.default_rng(given.seed)
    network = torch.nn.Sequential(policy.mlp_extractor.policy_net, policy.action_net)
    adam = torch.optim.AdamW(network.parameters())
    inputs = []
    outputs = []
    begun = time.process_time()
    learned = None

    def act(observation):
        added = teacher.command(*env.seen).qdd - law.command(*env.seen).qdd
        inputs.append(observation)
        outputs.append(np.clip(added / given.acceleration, -1.0, 1.0))
        return outputs[-1] if learned is None else learned.action(observation)

    while (share := (time.process_time() - begun) / given.imitation) < 1.0:
        few = random.choice(given.scenes, min(40, given.scenes), replace=False)
        for scene in few if learned else range(given.scenes):
            episode(env, scene, act)
        x, y = (torch.as_tensor(np.array(each, dtype=np.float32)) for each in (inputs, outputs))
        adam.param_groups[0]["lr"] = 1e-3 * max(0.03, 1.0 - share)
        for _ in range(1000):
            some = torch.randint(len(x), (1024,))
            away = network(x[some]) - y[some]
            adam.zero_grad()
            (away.abs().mean() + (away**2).mean()).backward()
            adam.step()
        learned = save(policy)


def developed(env, policy):
    """Mean return on the scenes that it learns from, and the share in which it arrives."""
    return np.mean(
        [episode(env, scene, save(policy).action) for scene in range(given.scenes)], axis=0
    )


def judge(name, controller, setups):
    """Print how often a law arrives, and how often without a violation of any row by more than 1 %
    of its scale.
    """
    scores = [score_run(setup, controller) for setup in setups]
    arrived = np.array([score.status == "converged" for score in scores])
    kept = arrived & np.array([score.sigma_max.max() <= 0.01 for score in scores])
    print(
        f"{name:20} arrives in {arrived.mean():4.0%}, and keeps all rows in {kept.mean():4.0%} of "
        f"{len(setups)} scenes"
    )


torch.set_num_threads(1)
options = {"scenes": given.family, "count": given.scenes, "law": given.law}
options |= {"acceleration": given.acceleration, "violation_weight": given.violation_weight}
model = PPO(
    "MlpPolicy",
    make_vec_env(ServoEnv, n_envs=4, seed=given.seed, env_kwargs=options),
    learning_rate=3e-5,
    n_steps=2048,
    batch_size=1024,
    n_epochs=5,
    gamma=0.998,
    target_kl=0.01,
    policy_kwargs={"net_arch": {"pi": [64, 64], "vf": [64, 64]}, "log_std_init": -3.5},
    seed=given.seed,
    device="cpu",
)
env = ServoEnv(**options)
imitate(model.policy, env)
imitated = developed(env, model.policy)
before = {key: each.clone() for key, each in model.policy.state_dict().items()}
model.learn(total_timesteps=10**9, callback=Until())
trained = developed(env, model.policy)
for name, (mean, arrived) in (("imitation", imitated), ("PPO", trained)):
    print(
        f"after {name}: mean return {mean:.2f}, arrives in {arrived:.0%} of the scenes it learns "
        f"from"
    )
if imitated[0] > trained[0]:
    model.policy.load_state_dict(before)
save(model.policy)

family = Family.load(given.family)
setups = [family.scene(number, "held-out").setup() for number in range(given.held_out)]
judge(given.law, make_controller(given.law), setups)
judge(given.teacher, make_controller(given.teacher), setups)
judge("policy", Policy(weights=given.out), setups)
judge("policy, filtered", Policy(weights=given.out, demand="barrier", resolver="filter"), setups)
