//! Threads that help the caller, kept between calls and safe after a fork.

use crate::error::{Error, Result};
use crate::interrupt;
use core::mem::replace;
use core::ops::Range;
use core::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

/// Bytes of stack: the kernels are inlined whole, which takes much in a build without optimisation.
const STACK: usize = 16 << 20;

/// Least remaining work for each helper [ns] on an idle machine: a helper starts 50 to 100 us after it is woken, and in
/// measurements 200 us of work took longer with a helper than without.
const WORTH: f64 = 250e3;

/// Least remaining work for each helper, in delays.
const DELAYS: f64 = 2.5;

/// Recent delay until helpers began [ns]: some tens of microseconds where a processor is idle, milliseconds where all
/// are busy, so that a helper costs more than it gains.
static DELAY: AtomicU64 = AtomicU64::new(0);

/// The delay is reduced by one part in so many with each call that had no helpers, so that they are tried again.
const FORGOTTEN: u64 = 64;

/// Time for which the caller polls for the end of the helpers before it sleeps; waking would take as long again.
const PATIENCE: Duration = Duration::from_micros(50);

/// A thread takes a run of tasks at a time: the remaining tasks over so many times the threads. Neighbouring results then
/// lie on memory pages of one thread, and the last runs are short.
const RUNS: usize = 4;

/// Does the tasks on at most `threads` threads (0: as many as this process may use); results in their order.
///
/// The caller's own thread is one of them. Others are woken where the remaining work takes long enough: by the shortest
/// duration `at_least` of a task in nanoseconds, or by the duration that the caller alone has measured.
///
/// # Errors
/// The threads could not be started, or the call is interrupted.
pub fn on_threads<T: Send, U: Send>(
    threads: usize,
    tasks: Vec<T>,
    at_least: f64,
    work: impl Fn(T) -> U + Sync,
) -> Result<Vec<U>> {
    let threads = match threads {
        0 => std::thread::available_parallelism().map_or(1, usize::from),
        given => given,
    };
    let most = threads.min(tasks.len());
    if most <= 1 {
        return tasks.into_iter().map(|task| interrupt::check().map(|()| work(task))).collect();
    }
    let places: Vec<_> = tasks.into_iter().map(|task| Mutex::new((Some(task), None))).collect();
    each(most, places.len(), at_least, &|number| {
        let mut place = lock(&places[number]);
        place.1 = place.0.take().map(&work);
    })?;
    Ok(places
        .into_iter()
        .filter_map(|place| place.into_inner().unwrap_or_else(PoisonError::into_inner).1)
        .collect())
}

/// Does the tasks of the numbers below `count` on two or more threads. Compiled once, not for each kind of task.
fn each(threads: usize, count: usize, at_least: f64, work: &(dyn Fn(usize) + Sync)) -> Result<()> {
    let began = Instant::now();
    let delay = DELAY.load(Ordering::Relaxed);
    let a_helper = WORTH.max(DELAYS * delay as f64);
    let mut next = 0;
    let mut worth = count as f64 * at_least / a_helper;
    while worth < 1.0 {
        if next == count {
            DELAY.store(delay - delay / FORGOTTEN, Ordering::Relaxed);
            return Ok(());
        }
        interrupt::check()?;
        work(next);
        next += 1;
        let a_task = began.elapsed().as_nanos() as f64 / next as f64;
        worth = (count - next) as f64 * a_task / a_helper;
    }
    let helpers = (threads - 1).min(count - next).min(worth as usize);
    let waiting = Mutex::new(next..count);
    Helpers::idle(threads - 1)?.share(helpers, &|| drain(&waiting, helpers + 1, work));
    interrupt::check()
}

/// Works, a run of numbers after the other, until none is left.
fn drain(waiting: &Mutex<Range<usize>>, threads: usize, work: &(dyn Fn(usize) + Sync)) {
    loop {
        let run = {
            let mut waiting = lock(waiting);
            let end = waiting.start + waiting.len().div_ceil(RUNS * threads);
            replace(&mut waiting.start, end)..end
        };
        if run.is_empty() {
            return;
        }
        for number in run {
            if interrupt::check().is_err() {
                return;
            }
            work(number);
        }
    }
}

/// A lock, whether or not its last owner panicked: all that is behind these is always whole.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Idle helpers by (process, number): after a fork the parent's threads do not exist, so the child makes its own.
static IDLE: OnceLock<Mutex<HashMap<Key, Vec<ThreadPool>>>> = OnceLock::new();

type Key = (u32, usize);

/// Threads that one call has for itself, so that calls from several threads do not wait for each other's tasks.
struct Helpers {
    key: Key,
    pool: ThreadPool,
}

impl Helpers {
    /// So many helpers that are idle, or new ones.
    fn idle(count: usize) -> Result<Self> {
        let key = (std::process::id(), count);
        let kept = lock(IDLE.get_or_init(Mutex::default)).get_mut(&key).and_then(Vec::pop);
        if let Some(pool) = kept {
            return Ok(Self { key, pool });
        }
        let pool = ThreadPoolBuilder::new()
            .num_threads(count)
            .stack_size(STACK)
            .thread_name(|index| format!("receptance-{index}"))
            .build()
            .map_err(|error| Error::Threads { threads: count, reason: error.to_string() })?;
        Ok(Self { key, pool })
    }

    /// Lets the caller and so many helpers do the same.
    fn share(self, count: usize, work: &(dyn Fn() + Sync)) {
        let ended = AtomicUsize::new(0);
        let called = Instant::now();
        let mark = interrupt::mark();
        self.pool.in_place_scope(|scope| {
            for _ in 0..count {
                scope.spawn(|_| {
                    let delay = called.elapsed().as_nanos() as u64;
                    DELAY.store(DELAY.load(Ordering::Relaxed).midpoint(delay), Ordering::Relaxed);
                    interrupt::helping(mark.clone(), work);
                    ended.fetch_add(1, Ordering::Release);
                });
            }
            work();
            let finished = Instant::now();
            while ended.load(Ordering::Acquire) < count {
                if finished.elapsed() < PATIENCE {
                    core::hint::spin_loop();
                    continue;
                }
                // Helpers may be at work for long, and only this thread checks whether the caller ends the call.
                if interrupt::check().is_err() {
                    break;
                }
                std::thread::sleep(PATIENCE);
            }
        });
        lock(IDLE.get_or_init(Mutex::default)).entry(self.key).or_default().push(self.pool);
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// Something that takes some microseconds and has a result.
    fn work(number: usize) -> f64 {
        (0..2000).fold(number as f64, |sum, step| (sum + f64::from(step)).sqrt())
    }

    #[test]
    fn results_are_in_the_order_of_the_tasks() {
        for count in [0, 1, 2, 3, 7, 100, 1000] {
            let expected: Vec<f64> = (0..count).map(work).collect();
            for threads in [0, 1, 2, 3, 8] {
                for at_least in [0.0, 1e9] {
                    let found = on_threads(threads, (0..count).collect(), at_least, work).unwrap();
                    assert!(found == expected, "{count} tasks, {threads} threads");
                }
            }
        }
    }

    #[test]
    fn tasks_may_share_their_work_again_and_callers_do_not_meet() {
        let inner = |number: usize| -> f64 {
            on_threads(2, (number..number + 50).collect(), 1e9, work).unwrap().iter().sum()
        };
        let expected: Vec<f64> = (0..20).map(inner).collect();
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| assert!(on_threads(3, (0..20).collect(), 1e9, inner).unwrap() == expected));
            }
        });
    }
}
