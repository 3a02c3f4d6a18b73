//! Pools of threads, kept between calls and safe after a fork.

use crate::error::{Error, Result};
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

/// Pools by (process, threads): after a fork the parent's threads do not exist, so the child makes its own.
static POOLS: OnceLock<Mutex<Pools>> = OnceLock::new();

/// Bytes of stack: the kernels are inlined whole, which takes much in a build without optimisation.
const STACK: usize = 16 << 20;

/// By process and number of threads.
type Pools = HashMap<(u32, usize), Arc<ThreadPool>>;

/// Does the tasks on at most `threads` threads (0: as many as this process may use); results in their order.
///
/// With one thread or one task the caller's own thread works, so that callers do not wait for each other.
///
/// # Errors
/// The threads could not be started.
pub fn on_threads<T: Send, U: Send>(
    threads: usize,
    tasks: Vec<T>,
    work: impl Fn(T) -> U + Send + Sync,
) -> Result<Vec<U>> {
    let threads = match threads {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        given => given,
    };
    let threads = threads.min(tasks.len());
    if threads <= 1 {
        return Ok(tasks.into_iter().map(work).collect());
    }
    let pool = pool(threads)?;
    Ok(pool.install(|| tasks.into_par_iter().map(work).collect()))
}

/// The pool of this process with so many threads.
fn pool(threads: usize) -> Result<Arc<ThreadPool>> {
    let mut pools = POOLS.get_or_init(Mutex::default).lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(pool) = pools.get(&(std::process::id(), threads)) {
        return Ok(Arc::clone(pool));
    }
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads)
        .stack_size(STACK)
        .thread_name(|index| format!("receptance-{index}"))
        .build()
        .map_err(|error| Error::Threads { threads, reason: error.to_string() })?;
    let pool = Arc::new(pool);
    pools.insert((std::process::id(), threads), Arc::clone(&pool));
    Ok(pool)
}
