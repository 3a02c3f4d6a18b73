//! Pools of threads, kept between calls and safe after a fork.

use crate::error::{Error, Result};
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Pools by (process, threads): after a fork the parent's threads do not exist, so the child makes its own.
static POOLS: OnceLock<Mutex<Pools>> = OnceLock::new();

/// Bytes of stack: the kernels are inlined whole, and a caller's own thread may have very little.
const STACK: usize = 16 << 20;

/// By process and number of threads.
type Pools = HashMap<(u32, usize), Arc<ThreadPool>>;

/// Runs `work` on at most `threads` threads (0: as many as this process may use).
///
/// `tasks` tells how much there is to share; with one task or one thread the caller's own thread works.
///
/// # Errors
/// The threads could not be started.
pub fn with_threads<T: Send>(threads: usize, tasks: usize, work: impl FnOnce() -> T + Send) -> Result<T> {
    let threads = match threads {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        given => given,
    };
    // Rayon's global pool would serve a parallel iterator that runs outside any pool, so one thread is a
    // pool of one as well.
    let threads = threads.min(tasks + 1);
    let key = (std::process::id(), threads);
    let pools = POOLS.get_or_init(Mutex::default);
    let pool = {
        let mut pools = pools.lock().unwrap_or_else(PoisonError::into_inner);
        match pools.get(&key) {
            Some(pool) => Arc::clone(pool),
            None => {
                let pool = ThreadPoolBuilder::new()
                    .num_threads(threads)
                    .stack_size(STACK)
                    .thread_name(|index| format!("receptance-{index}"))
                    .build()
                    .map_err(|error| Error::Threads { threads, reason: error.to_string() })?;
                let pool = Arc::new(pool);
                pools.insert(key, Arc::clone(&pool));
                pool
            }
        }
    };
    Ok(pool.install(work))
}
