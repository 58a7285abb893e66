"""One thread for linear algebra: on matrices as small as these, further threads only wait."""

from threadpoolctl import threadpool_limits

# The function that this decorates has one thread until it ends; then the others are back.
one_thread = threadpool_limits.wrap(limits=1, user_api="blas")
