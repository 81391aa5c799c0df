"""Linear algebra on one thread: for the call only."""

from threadpoolctl import threadpool_info, threadpool_limits

from draglag.system.blas import one_blas_thread


def _threads() -> set[int]:
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def test_a_call_computes_on_one_thread_and_leaves_the_process_as_it_was() -> None:
    import scipy.linalg  # noqa: F401  (has a BLAS of its own)

    with threadpool_limits(limits=2, user_api="blas"):
        before = _threads()
        inside = one_blas_thread(_threads)()
        after = _threads()
    assert inside == {1}
    assert after == before
