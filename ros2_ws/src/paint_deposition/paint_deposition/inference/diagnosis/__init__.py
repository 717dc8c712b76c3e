"""Which effect a model misses: sensitivities, evidence, verdict, next experiment."""
