//! Standard output.

use std::io::{ErrorKind, Result, Stdout, Write};

/// Standard output, which a reader may close early, as `head` does, without an error.
pub fn stdout() -> impl Write {
    UntilClosed(std::io::stdout())
}

struct UntilClosed(Stdout);

impl Write for UntilClosed {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        unless_closed(self.0.write(bytes), bytes.len())
    }

    fn flush(&mut self) -> Result<()> {
        unless_closed(self.0.flush(), ())
    }
}

fn unless_closed<T>(result: Result<T>, done: T) -> Result<T> {
    match result {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(done),
        result => result,
    }
}
