"""The simulated table: Bullet's world, the batched simulator, teach mode, pictures."""
