"""Linear algebra on one thread."""

from threadpoolctl import threadpool_limits

# For functions: BLAS has one thread while they run. Threads that share matrices as small as those
# of a fit mostly wait for each other, on a busy machine ten times as long as the work takes.
on_one_thread = threadpool_limits.wrap(limits=1, user_api='blas')
