"""Speed against peers: same data, same run, ratios printed. Run with `make bench`.

Whatever is run from here has one thread of linear algebra, as commands have: else threads that spin
beside small matrices are counted (a fit of the local page took 240 ms of processor time, or 1,600).
"""

from flightid.threads import one_linear_algebra_thread

one_linear_algebra_thread()
