//! An installed browser of the Chromium family, which turns pages into PDF.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};
use stonewise_base::error::Error;
use stonewise_core::progress::Progress;

/// Environment variable that names the browser's program, where it is in none of the usual places.
const VARIABLE: &str = "STONEWISE_BROWSER";
/// Programs on the path, in the order in which they are tried.
const PROGRAMS: [&str; 9] = [
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "microsoft-edge",
    "microsoft-edge-stable",
    "msedge",
    "brave-browser",
];
/// Where installers of macOS and Windows put them, beside the path; the first part is an environment
/// variable, or empty.
const PLACES: [(&str, &str); 7] = [
    ("", "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome"),
    ("", "/Applications/Chromium.app/Contents/MacOS/Chromium"),
    (
        "",
        "/Applications/Microsoft Edge.app/Contents/MacOS/Microsoft Edge",
    ),
    ("ProgramFiles", "Google/Chrome/Application/chrome.exe"),
    ("ProgramFiles(x86)", "Google/Chrome/Application/chrome.exe"),
    ("LocalAppData", "Google/Chrome/Application/chrome.exe"),
    ("ProgramFiles(x86)", "Microsoft/Edge/Application/msedge.exe"),
];
/// Longest time that a browser may take: a report on 10,000 stones takes well below a minute on one core.
const LIMIT: Duration = Duration::from_secs(600);
/// How often the browser is looked after.
const LOOK: Duration = Duration::from_millis(50);

/// The browser's program.
#[derive(Debug)]
pub struct Browser(PathBuf);

impl Browser {
    /// Looks for a browser where they usually are, the one that `STONEWISE_BROWSER` names first.
    ///
    /// # Errors
    /// There is none; the message says what to install.
    pub fn find() -> Result<Self, Error> {
        if let Some(named) = std::env::var_os(VARIABLE).filter(|n| !n.is_empty()) {
            let path = PathBuf::from(&named);
            return match path.is_file() {
                true => Ok(Self(path)),
                false => Err(Error::Pdf(format!(
                    "{VARIABLE} = {} is no file; give the program of Chromium, Chrome or Edge",
                    path.display()
                ))),
            };
        }
        let path = std::env::var_os("PATH").unwrap_or_default();
        let on_path = std::env::split_paths(&path).flat_map(|folder| {
            let program = |name: &str| folder.join(format!("{name}{}", std::env::consts::EXE_SUFFIX));
            PROGRAMS.map(program)
        });
        let installed = PLACES.iter().filter_map(|(variable, rest)| match *variable {
            "" => Some(PathBuf::from(rest)),
            variable => Some(PathBuf::from(std::env::var_os(variable)?).join(rest)),
        });
        on_path.chain(installed).find(|p| p.is_file()).map(Self).ok_or_else(|| {
            Error::Pdf(format!(
                "a PDF is printed by Chromium, Chrome or Edge, and none is installed: install one (on Debian and Ubuntu `apt install \
                 chromium`), name its program in {VARIABLE}, or open report.html in any browser and print it to a file"
            ))
        })
    }

    /// The program.
    pub fn program(&self) -> &Path {
        &self.0
    }

    /// Prints the page `html` (a file) to the file `pdf`; `folder` is empty and takes what the browser writes
    /// for itself.
    ///
    /// # Errors
    /// The browser cannot be started, fails or takes too long; the caller stopped the work.
    pub fn print(
        &self,
        html: &Path,
        pdf: &Path,
        folder: &Path,
        progress: &dyn Progress,
    ) -> Result<(), Error> {
        let log = folder.join("log.txt");
        let words = fs::File::create(&log).map_err(Error::io("writing", &log))?;
        let child = self
            .command(html, pdf, folder)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(words)
            .spawn()
            .map_err(Error::io("starting the browser", &self.0))?;
        let ended = wait(child, progress)?;
        match ended && is_pdf(pdf) {
            true => Ok(()),
            false => Err(Error::Pdf(format!(
                "{} printed no PDF{}",
                self.0.display(),
                last_words(&log)
            ))),
        }
    }

    fn command(&self, html: &Path, pdf: &Path, folder: &Path) -> Command {
        let option = |name: &str, value: &Path| {
            let mut text = OsString::from(name);
            text.push(value);
            text
        };
        let mut command = Command::new(&self.0);
        command.args([
            "--headless",
            "--disable-gpu",
            "--disable-extensions",
            "--no-first-run",
            "--no-default-browser-check",
            "--disable-background-networking",
            "--no-pdf-header-footer",
        ]);
        if is_root() {
            // Chromium refuses to start for root otherwise; the page comes from this program and runs no
            // scripts.
            command.arg("--no-sandbox");
        }
        command.args([
            option("--user-data-dir=", folder),
            option("--print-to-pdf=", pdf),
            option("", html),
        ]);
        command
    }
}

/// Waits for the browser; whether it ended well. It is ended where the caller stops or it takes too long.
fn wait(mut child: Child, progress: &dyn Progress) -> Result<bool, Error> {
    let started = Instant::now();
    loop {
        if let Ok(Some(status)) = child.try_wait() {
            return Ok(status.success());
        }
        let stopped = progress.check();
        if stopped.is_err() || started.elapsed() > LIMIT {
            // It may have ended in the meantime.
            let _ = child.kill();
            let _ = child.wait();
            stopped?;
            return Ok(false);
        }
        sleep(LOOK);
    }
}

/// Whether the file is a whole PDF (ISO 32000-1, 7.5.2 and 7.5.5).
fn is_pdf(path: &Path) -> bool {
    let bytes = fs::read(path).unwrap_or_default();
    let end = &bytes[bytes.len().saturating_sub(64)..];
    bytes.starts_with(b"%PDF-") && end.windows(5).any(|w| w == b"%%EOF")
}

/// What the browser said last.
fn last_words(log: &Path) -> String {
    let text = fs::read_to_string(log).unwrap_or_default();
    let lines: Vec<&str> = text.lines().filter(|l| !l.trim().is_empty()).collect();
    match lines[lines.len().saturating_sub(3)..].join(" / ") {
        words if words.is_empty() => String::new(),
        words => format!(": {words}"),
    }
}

#[cfg(unix)]
fn is_root() -> bool {
    use std::os::unix::fs::MetadataExt;
    fs::metadata("/proc/self").is_ok_and(|m| m.uid() == 0)
}

#[cfg(not(unix))]
fn is_root() -> bool {
    false
}
