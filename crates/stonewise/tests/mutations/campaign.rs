//! Tries mutated inputs of a reader.

use super::edit::Input;
use super::limits::{Memory, processor_time};
use super::targets::Target;
use bolero_engine::{Engine, Test, driver::Options, input::Bytes};
use rand::{Rng as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use std::fmt::Debug;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Inputs of a reader, unless told otherwise.
const INPUTS: u64 = 60;
/// Bytes that the choices of one input are made from.
const CHOICES: usize = 256;
/// Processor time for one input, all threads.
const MOST_TIME: Duration = Duration::from_secs(2);
/// Memory that one input may take beyond what is there, bytes.
const MOST_MEMORY: u64 = 512 << 20;

/// Runs a test on inputs that are the same each time; bolero's own engine draws other ones each time.
pub struct SameInputs;

impl<T: Test> Engine<T> for SameInputs
where
    T::Value: Debug,
{
    type Output = ();

    fn run(self, mut test: T, options: Options) {
        let told = |name: &str| std::env::var(name).ok().map(|text| text.parse::<u64>().unwrap());
        let first = told("BOLERO_RANDOM_SEED").unwrap_or(0);
        for number in first..first + told("BOLERO_RANDOM_ITERATIONS").unwrap_or(INPUTS) {
            let mut bytes = vec![0; CHOICES];
            ChaCha8Rng::seed_from_u64(number).fill_bytes(&mut bytes);
            if let Err(error) = test.test(&mut Bytes::new(&bytes, &options)) {
                let shrunk = test.shrink(bytes, None, &options);
                let _ = std::panic::take_hook();
                panic!(
                    "{}",
                    shrunk.map_or(error.to_string(), |failure| failure.to_string())
                );
            }
        }
    }
}

/// A reader with the folder that its inputs lie in.
pub struct Campaign {
    name: &'static str,
    target: Target,
    home: TempDir,
    accepted: AtomicU64,
    refused: AtomicU64,
    /// Time and memory are those of the whole program, so campaigns take turns.
    _turn: MutexGuard<'static, ()>,
}

impl Campaign {
    pub fn new(name: &'static str, target: Target) -> Self {
        static TURN: Mutex<()> = Mutex::new(());
        let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        // Decoders of others panic behind a wall of ours; that is not worth a line each.
        std::panic::set_hook(Box::new(|_| {}));
        let home = tempfile::tempdir().unwrap();
        target.prepare(home.path());
        Self {
            name,
            target,
            home,
            accepted: AtomicU64::new(0),
            refused: AtomicU64::new(0),
            _turn: turn,
        }
    }

    /// Reads an input; panics where it does harm.
    pub fn try_input(&self, input: &Input) {
        let (name, bytes) = self.target.bytes_of(input);
        let path = self.home.path().join(&name);
        fs::write(&path, &bytes).unwrap();
        match self.read(&path) {
            Ok(true) => self.accepted.fetch_add(1, Relaxed),
            Ok(false) => self.refused.fetch_add(1, Relaxed),
            Err(harm) => {
                let kept = std::env::temp_dir().join(format!("stonewise-{}-{name}", self.name));
                fs::write(&kept, &bytes).unwrap();
                panic!("{harm} (kept as {})", kept.display());
            }
        };
    }

    /// Whether the reader accepts the file; else what harm it did.
    fn read(&self, path: &Path) -> Result<bool, String> {
        let memory = Memory::now();
        let (start, processor) = (Instant::now(), processor_time());
        let read = catch_unwind(AssertUnwindSafe(|| (self.target.read)(path)));
        let time = match (processor, processor_time()) {
            (Some(before), Some(now)) => now - before,
            _ => start.elapsed(),
        };
        if time > MOST_TIME {
            return Err(format!("took {time:?}"));
        }
        if memory.highest() > MOST_MEMORY {
            return Err(format!("took {} MiB", memory.highest() >> 20));
        }
        match read {
            Err(panic) => {
                let text = panic.downcast_ref::<String>().cloned();
                let text = text.or_else(|| panic.downcast_ref::<&str>().map(|t| (*t).to_owned()));
                Err(format!("panic: {}", text.unwrap_or_default()))
            }
            Ok(Ok(())) => Ok(true),
            Ok(Err(message)) if !message.contains(&self.home.path().display().to_string()) => {
                Err(format!("an error that names no file: {message}"))
            }
            Ok(Err(_)) => Ok(false),
        }
    }

    /// A reader that accepts all, or nothing, was not tried.
    pub fn end(self) {
        let _ = std::panic::take_hook();
        let (accepted, refused) = (self.accepted.into_inner(), self.refused.into_inner());
        assert!(
            accepted > 0 && refused > 0,
            "{accepted} accepted, {refused} refused"
        );
    }
}
