//! A wall around libraries that panic on damaged bytes.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Steps of other libraries under way.
static UNDER_WAY: AtomicUsize = AtomicUsize::new(0);

/// Runs a step of another library; `None` where it panicked. Whatever the step left behind must not be used
/// then.
pub(crate) fn behind_wall<T>(step: impl FnOnce() -> T) -> Option<T> {
    UNDER_WAY.fetch_add(1, Ordering::SeqCst);
    let done = catch_unwind(AssertUnwindSafe(step));
    UNDER_WAY.fetch_sub(1, Ordering::SeqCst);
    done.ok()
}

/// Whether a step is under way whose panic becomes an error that names the file: no line about the panic
/// itself is due.
pub fn is_behind_wall() -> bool {
    UNDER_WAY.load(Ordering::SeqCst) > 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_ends_the_step_and_nothing_else() {
        std::panic::set_hook(Box::new(|_| {}));
        assert_eq!(behind_wall(|| 3), Some(3));
        let mut was_behind = false;
        let none: Option<()> = behind_wall(|| {
            was_behind = is_behind_wall();
            panic!("damaged");
        });
        let _ = std::panic::take_hook();
        assert!(none.is_none() && was_behind);
    }
}
