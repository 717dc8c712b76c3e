"""Patterns that try out one thing each."""

from paint_deposition.model.eq1_pattern import PlanarPattern

RING = PlanarPattern(K2=0.15, K3=0.3, phi_rad=0.7, r_m=0.22, sigma1_m=0.09, sigma2_m=0.15)
PATTERNS = {
    'ring': RING,
    'default': PlanarPattern(),
    'ring only': PlanarPattern(K2=0.0, K3=0.9),
    'centre only': PlanarPattern(K2=1.0),
    'spot': PlanarPattern(r_m=0.0, K2=0.5, sigma1_m=0.03, sigma2_m=0.02),
    'volcano without a hole': PlanarPattern(r_m=0.0, K3=0.9, sigma1_m=0.1),
    'thin ring': PlanarPattern(
        r_m=0.3, sigma1_m=0.015, K2=0.4, K3=0.5, phi_rad=-2.0, sigma2_m=0.03
    ),
}
