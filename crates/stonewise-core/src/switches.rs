//! Mechanisms of the method that a build for the laboratory (feature `lab`) can switch off, to weigh what each
//! contributes. In every other build all of them work, and nothing of this is left in the program.

/// Whether a mechanism works: always.
#[cfg(not(feature = "lab"))]
pub(crate) const fn is_on(_name: &str) -> bool {
    true
}

/// What a mechanism makes, or the other where it is switched off.
pub(crate) fn where_on<T>(name: &str, made: T, otherwise: T) -> T {
    if is_on(name) { made } else { otherwise }
}

/// Ends a function, with a value or without one, where a mechanism is switched off.
macro_rules! switchable {
    ($name:literal $(, $otherwise:expr)?) => {
        if !$crate::switches::is_on($name) {
            return $($otherwise)?;
        }
    };
}

pub(crate) use switchable;

#[cfg(feature = "lab")]
pub(crate) use lab::is_on;
#[cfg(feature = "lab")]
pub use lab::{SWITCHES, switch_off};

#[cfg(feature = "lab")]
mod lab {
    use std::sync::atomic::{AtomicU64, Ordering};

    /// Names of all mechanisms that can be switched off.
    pub const SWITCHES: [&str; 22] = [
        "across",
        "bodies",
        "correlation",
        "covered",
        "crack",
        "foreign",
        "obs_average",
        "obs_drift",
        "obs_gross",
        "obs_stretch",
        "obs_widened",
        "octaves_shown",
        "partial",
        "probe",
        "sensors",
        "shared",
        "slide",
        "slopes",
        "stone_factor",
        "tie_t",
        "two_surfaces",
        "zone",
    ];

    /// Those that are off, as bits in the order of their names.
    static OFF: AtomicU64 = AtomicU64::new(0);

    /// Switches mechanisms off for the rest of this process, and all others on.
    ///
    /// # Errors
    /// A name that no mechanism has.
    pub fn switch_off(names: &[String]) -> Result<(), String> {
        let mut off = 0;
        for name in names {
            let Some(bit) = SWITCHES.iter().position(|s| s == name) else {
                return Err(format!(
                    "no mechanism is called {name}: there are {}",
                    SWITCHES.join(", ")
                ));
            };
            off |= 1 << bit;
        }
        OFF.store(off, Ordering::Relaxed);
        Ok(())
    }

    /// Whether a mechanism works.
    pub(crate) fn is_on(name: &str) -> bool {
        let off = OFF.load(Ordering::Relaxed);
        off == 0
            || !SWITCHES
                .iter()
                .enumerate()
                .any(|(bit, s)| *s == name && off >> bit & 1 == 1)
    }

    #[cfg(test)]
    mod tests {
        use super::*;
        use std::collections::BTreeSet;
        use std::path::Path;

        /// Names between quotes after the uses of switches, in all files below a folder.
        fn used(folder: &Path, names: &mut BTreeSet<String>) {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    used(&path, names);
                } else if path.file_name().is_some_and(|n| n != "switches.rs") {
                    let text = std::fs::read_to_string(&path).unwrap();
                    for start in ["is_on(\"", "where_on(\"", "switchable!(\""] {
                        names.extend(
                            text.split(start)
                                .skip(1)
                                .filter_map(|t| Some(t.split_once('"')?.0.to_owned())),
                        );
                    }
                }
            }
        }

        #[test]
        fn every_switch_is_used_and_every_use_has_a_name() {
            let mut names = BTreeSet::new();
            used(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), &mut names);
            assert_eq!(names, SWITCHES.iter().map(ToString::to_string).collect());
        }

        #[test]
        fn a_switch_is_off_until_it_is_on_again() {
            switch_off(&["crack".to_owned()]).unwrap();
            assert!(!is_on("crack") && is_on("probe"));
            switch_off(&[]).unwrap();
            assert!(is_on("crack"));
            assert!(switch_off(&["no".to_owned()]).is_err());
        }
    }
}
