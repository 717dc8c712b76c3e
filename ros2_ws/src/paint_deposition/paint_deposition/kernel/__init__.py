"""The hot loop: flux summed over sub-steps and points, compiled with the laws of effects."""
