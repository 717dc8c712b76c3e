"""The atomizer's way: recorded poses, planned passes and the sub-steps both become."""
