"""Train one learner in five lines and print what it earns."""

from hyuav import DDPG, Learner, Scenario, Training, TrainingParameters

scenario, learners = Scenario.preset("two_clusters"), [Learner("hybrid", seed=0)]
training = Training(scenario, learners, DDPG(), TrainingParameters(num_episodes=20))
for episode in training.episodes():
    print(f"episode {episode.number}: {float(episode.accumulated_reward):.2f} bps/Hz")
