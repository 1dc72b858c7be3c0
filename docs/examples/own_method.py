"""A method of one's own: MSRD without cross-negatives."""

import dataclasses

import msrd_ros.learning as msrd


class WithoutCrossNegatives(msrd.Method):
    """The recipe with the weight of cross-negatives at zero."""

    name = "without-cross-negatives"
    title = "MSRD without cross-negatives"

    def configure(self, config: msrd.MSRDConfig, strategies: int) -> msrd.MSRDConfig:
        """The recipe with this method's own change."""
        return dataclasses.replace(
            config, discriminator=dataclasses.replace(config.discriminator, cross_weight=0.0)
        )


method = msrd.find_method(WithoutCrossNegatives())
print(method.title, method.configure(msrd.default_config(), 2).discriminator.cross_weight)
