"""Two ways to land: what both want, what each wants beside it, and how to do it."""

import msrd_ros.learning as msrd

ENVIRONMENT = "LunarLanderContinuous-v3"
# Ten landings that swing out to the left on their way down, and ten that swing out to the right.
demonstrations = msrd.example_demonstrations("lunar_lander")
learned = msrd.train(demonstrations, ENVIRONMENT)

# Columns: x, y, vx, vy, angle, rate, left leg, right leg.
landed, crashed = [0.0, 0, 0, 0, 0, 0, 1, 1], [0.5, 0, 0, 0, 1.5, 0, 1, 0]
print("task reward, landed and crashed:", learned.task_reward([landed, crashed]))
for name in learned.labels:
    sides = learned.strategy_reward(name, [[x, 0.7, 0, -0.3, 0, 0, 0, 0] for x in (-0.3, 0.3)])
    print(f"{name}: strategy reward at the left and at the right: {sides}")
    returns = msrd.play(learned.policy(name), ENVIRONMENT)
    print(f"{name}: the environment's own return is {sum(returns) / len(returns):.0f}")
learned.save("landers.safetensors")
