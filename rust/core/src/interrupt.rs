//! Calls that can be interrupted: their caller is polled, and no new task begins after it ends the call.

use crate::error::{Error, Result};
use core::cell::RefCell;
use core::sync::atomic::{AtomicBool, Ordering};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Time between two polls of the caller.
const INTERVAL: Duration = Duration::from_millis(50);

/// What ends a call in all of its threads.
#[derive(Clone, Default)]
pub(crate) struct Mark {
    call: Arc<AtomicBool>,
    /// Of the `Halt` that the caller has joined.
    halt: Option<Arc<AtomicBool>>,
}

impl Mark {
    fn is_set(&self) -> bool {
        self.call.load(Ordering::Relaxed)
            || self.halt.as_ref().is_some_and(|halt| halt.load(Ordering::Relaxed))
    }
}

/// State of a call in one of its threads.
struct Call {
    mark: Mark,
    /// Whether the caller has ended the call; only the caller's own thread polls.
    poll: Option<fn() -> bool>,
    next: Instant,
}

thread_local! {
    static CALL: RefCell<Option<Call>> = const { RefCell::new(None) };
    /// The mark of all calls of this thread, if it has joined a `Halt`.
    static JOINED: RefCell<Option<Arc<AtomicBool>>> = const { RefCell::new(None) };
}

/// Ends the calls of threads that work for another one, which is the only thread that signals reach.
#[derive(Clone, Debug, Default)]
pub struct Halt(Arc<AtomicBool>);

impl Halt {
    /// From now on the calls of this thread end when it is set.
    pub fn join(&self) {
        JOINED.replace(Some(self.0.clone()));
    }

    /// Ends running and later calls of all threads that have joined.
    pub fn set(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Puts the call of before back in its place, also after a panic.
struct Restore(Option<Call>);

impl Drop for Restore {
    fn drop(&mut self) {
        CALL.replace(self.0.take());
    }
}

/// Does the work; where `poll`, called on this thread every 50 ms between tasks, returns true the work ends early, with
/// `Error::Interrupted` or with results that are not to be used.
pub fn interruptible<T>(poll: fn() -> bool, work: impl FnOnce() -> T) -> T {
    let mark = Mark { halt: JOINED.with_borrow(Clone::clone), ..Mark::default() };
    within(Call { mark, poll: Some(poll), next: Instant::now() + INTERVAL }, work)
}

/// The mark of the call that this thread works for.
pub(crate) fn mark() -> Option<Mark> {
    CALL.with_borrow(|call| call.as_ref().map(|call| call.mark.clone()))
}

/// Does work for the call of another thread.
pub(crate) fn helping<T>(mark: Option<Mark>, work: impl FnOnce() -> T) -> T {
    match mark {
        Some(mark) => within(Call { mark, poll: None, next: Instant::now() }, work),
        None => work(),
    }
}

fn within<T>(call: Call, work: impl FnOnce() -> T) -> T {
    let _restore = Restore(CALL.replace(Some(call)));
    work()
}

/// Calls the check of the caller if it is due.
///
/// # Errors
/// The call is interrupted.
pub(crate) fn check() -> Result<()> {
    let due = CALL.with_borrow_mut(|call| {
        let call = call.as_mut()?;
        let poll = call.poll.filter(|_| Instant::now() >= call.next)?;
        call.next = Instant::now() + INTERVAL;
        Some(poll)
    });
    // Not while the cell is borrowed: the caller may make another call.
    if due.is_some_and(|poll| poll()) {
        end();
    }
    let ended = CALL.with_borrow(|call| call.as_ref().is_some_and(|call| call.mark.is_set()));
    if ended { Err(Error::Interrupted) } else { Ok(()) }
}

/// Ends the call in all of its threads.
pub(crate) fn end() {
    CALL.with_borrow(|call| {
        if let Some(call) = call {
            call.mark.call.store(true, Ordering::Relaxed);
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stop_ends_the_calls_of_threads_that_have_joined() {
        let halt = Halt::default();
        let never = || false;
        std::thread::scope(|scope| {
            scope.spawn(|| {
                halt.join();
                assert!(interruptible(never, check).is_ok());
                halt.set();
                assert!(interruptible(never, check).is_err());
            });
        });
        assert!(interruptible(never, check).is_ok(), "this thread has not joined");
    }
}
