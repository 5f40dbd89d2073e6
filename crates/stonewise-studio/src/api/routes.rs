//! What each address answers.

use super::types::{
    Act, Change, CheckShown, EditsShown, FindingShown, MistakeShown, NewEdits, ProjectChanges, ProjectShown,
    ProposalShown, State, Weight,
};
use crate::assets;
use crate::elsewhere::unfinished;
use crate::epochs::{epochs, picture};
use crate::guard::Guard;
use crate::http::{Body, Head, Method, Request, Response, Site};
use crate::journal::Journal;
use crate::place::Place;
use crate::project_text::{self, Mistake, Step};
use crate::remarks;
use crate::sightings::{sighting, sightings};
use crate::stable::{self, NewStable};
use crate::teaching::{self, NewTeaching};
use crate::wall::wall_of;
use crate::work::{Job, Phase, Run, RunShown};
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::io::{self, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant, UNIX_EPOCH};
use stonewise::check::{Depth, Finding, Verdict, check};
use stonewise::edits::{Edit, EditsFile};
use stonewise::project::{project_schema, propose};
use stonewise::results::names::{PairFile, RUN, is_report_page};
use stonewise::results::records::Timestamp;
use stonewise::results::{ResultSet, read_outlines};
use stonewise::{Error, Language, OutputFolder, Project, Until};
use stonewise_base::files::write_text;
use stonewise_core::progress::Silent;

/// Where the API begins.
const API: &str = "/api/v1";
/// Most pages that receive changes at a time.
const WATCHERS: usize = 24;
/// Time between two events of one page at least, and at most.
const EVENTS: (Duration, Duration) = (Duration::from_millis(150), Duration::from_secs(4));
/// Name of the file of edits where the project names none.
const EDITS_FILE: &str = "edits.json";
/// Longest name of an act.
const LONGEST_ID: usize = 100;

/// The library behind the page.
pub struct Api {
    guard: Guard,
    place: Place,
    run: Run,
    look: Mutex<Look>,
    journal: Mutex<Option<Journal>>,
    /// One change of the project file at a time.
    project: Mutex<()>,
    /// One photo in memory at a time.
    photo: Mutex<()>,
    pages: Pages,
}

/// The look at the survey.
#[derive(Default)]
struct Look {
    shown: CheckShown,
    page: Option<String>,
    /// The project changed since it began.
    is_stale: bool,
}

/// The pages that are open.
#[derive(Default)]
struct Pages {
    open: AtomicUsize,
    last_closed: Mutex<Option<Instant>>,
}

/// Counts a page while it is told of changes.
struct OpenPage(Arc<Api>);

impl Drop for OpenPage {
    fn drop(&mut self) {
        let pages = &self.0.pages;
        pages.open.fetch_sub(1, Ordering::SeqCst);
        *locked(&pages.last_closed) = Some(Instant::now());
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl From<Mistake> for Response {
    fn from(mistake: Mistake) -> Self {
        Self::json(422, &MistakeShown::from(mistake))
    }
}

impl From<Mistake> for MistakeShown {
    fn from(Mistake { message, line, way }: Mistake) -> Self {
        Self { message, line, way }
    }
}

/// The library's errors: what is wrong with what was given, else of the machine.
fn failed(error: &Error) -> Response {
    let status = match error {
        Error::Busy { .. } => 409,
        Error::Io { .. } => 500,
        _ => 422,
    };
    Response::json(
        status,
        &MistakeShown {
            message: error.to_string(),
            line: None,
            way: Vec::new(),
        },
    )
}

/// A request that can still be answered by an error.
type Answer = Result<Response, Response>;

/// The site with the API.
pub struct Served(pub Arc<Api>);

impl Site for Served {
    fn admit(&self, head: &Head) -> Result<(), Response> {
        self.0.guard.admit(head)
    }

    fn answer(&self, request: &Request) -> Response {
        self.0.answer(request).unwrap_or_else(|error| error)
    }
}

impl Api {
    /// Everything for what was opened.
    pub fn new(guard: Guard, place: Place) -> Arc<Self> {
        let api = Arc::new(Self {
            guard,
            place,
            run: Run::default(),
            look: Mutex::default(),
            journal: Mutex::default(),
            project: Mutex::default(),
            photo: Mutex::default(),
            pages: Pages::default(),
        });
        api.look_again();
        api
    }

    /// What stands in front of it.
    pub fn guard(&self) -> &Guard {
        &self.guard
    }

    /// The run.
    pub fn run(&self) -> &Run {
        &self.run
    }

    /// Whether the last page was closed so long ago; never before one was open.
    pub fn is_left(&self, since: Duration) -> bool {
        let closed = *locked(&self.pages.last_closed);
        self.pages.open.load(Ordering::SeqCst) == 0 && closed.is_some_and(|c| c.elapsed() >= since)
    }

    fn answer(self: &Arc<Self>, request: &Request) -> Answer {
        use Method::{Delete, Get, Patch, Post};
        let head = &request.head;
        let path = head.path.as_str();
        let Some(call) = path.strip_prefix(API) else {
            return match (head.method, path) {
                (Get, "/") => Ok(self.shell(head)),
                (Get, "/studio.js") => Ok(assets::script()),
                (Get, "/studio.css") => Ok(assets::style()),
                (Get, "/check") => self.check_page(),
                (Get, path) => self.report(path.strip_prefix("/report/").unwrap_or("")),
                _ => Err(unknown()),
            };
        };
        match (head.method, call) {
            (Get, "/state") => Ok(Response::json(200, &self.state())),
            (Get, "/events") => self.events(),
            (Post, "/allow") => {
                self.guard.allow();
                self.run.touch();
                Ok(Response::json(200, &self.state()))
            }
            (Get, "/schema") => Ok(Response::json(200, &project_schema())),
            (Get, "/project") => Ok(Response::json(200, &self.project_shown())),
            (Post, "/project") => self.init_project(),
            (Patch, "/project") => self.change_project(&body(request)?),
            (Post, "/stable") => self.add_stable(&body(request)?),
            (Post, "/run") => self.start(),
            (Delete, "/run") => {
                self.run.stop();
                Ok(Response::json(200, &self.state()))
            }
            (Get, "/teaching") => self.teaching(),
            (Post, "/teaching") => self.teach(&body(request)?),
            (Post, "/teaching/accept") => self.accept_taught(),
            (Delete, "/teaching") => self.close_offer(),
            (Get, "/edits") => Ok(Response::json(200, &self.edits()?)),
            (Post, "/edits") => self.add_edits(body(request)?),
            (Post, "/edits/undo") => self.act(&body(request)?, Journal::undo),
            (Post, "/edits/redo") => self.act(&body(request)?, Journal::redo),
            (Get, "/remarks") => self.remarks(),
            (Post, "/remarks") => {
                let new = body(request)?;
                self.say(|results| remarks::add(results, new))
            }
            (Delete, "/remarks") => {
                let old = body(request)?;
                self.say(|results| remarks::remove(results, &old))
            }
            (Post, "/signature") => {
                let new = body(request)?;
                self.say(|results| remarks::sign(results, new))
            }
            (Delete, "/signature") => self.say(remarks::unsign),
            (Post, "/pdf") => self.pdf(),
            (Get, call) => self.of_epoch(call),
            _ => Err(unknown()),
        }
    }

    /// The page itself, in the project's language, else the browser's.
    fn shell(&self, head: &Head) -> Response {
        let wanted = head.header("accept-language").unwrap_or_default();
        let by_browser = Language::ALL
            .into_iter()
            .find(|language| wanted.starts_with(language.tag()));
        let project = self.read_project().ok();
        let language = project.map(|p| p.settings.report.language);
        assets::shell(language.or(by_browser).unwrap_or_default())
    }

    /// A page of the report, which holds its own scripts.
    fn report(&self, name: &str) -> Answer {
        let is_page = is_report_page(Path::new(name));
        let (file, length) = self
            .place
            .open(&self.place.results, name)
            .filter(|_| is_page)
            .ok_or_else(unknown)?;
        Ok(Response::new(200, assets::HTML, Body::File(file, length)).sealed())
    }

    fn check_page(&self) -> Answer {
        let page = locked(&self.look).page.clone().ok_or_else(unknown)?;
        Ok(Response::new(200, assets::HTML, Body::Bytes(page.into_bytes().into())).sealed())
    }

    /// What is seen of an epoch: a picture of it, the photos that show a stone, a piece of one of them.
    fn of_epoch(&self, call: &str) -> Answer {
        let parts: Vec<&str> = call.strip_prefix("/epochs/").unwrap_or("").split('/').collect();
        let number = |text: &str| text.parse::<usize>().map_err(|_| unknown());
        let epoch = number(parts[0])?;
        let project = self.read_project()?;
        let epoch = project.epochs.get(epoch).ok_or_else(unknown)?;
        let outline = |id: &str| {
            let outlines = read_outlines(&self.place.results).map_err(|e| failed(&e))?;
            let stone = outlines.into_iter().find(|(stone, _)| stone.to_string() == id);
            stone.map(|(_, outline)| outline).ok_or_else(unknown)
        };
        let jpeg = match parts[1..] {
            ["picture"] => picture(epoch, &self.place),
            ["stones", id] => {
                let seen = sightings(epoch, &outline(id)?, &self.place).map_err(|e| failed(&e))?;
                return Ok(Response::json(200, &seen));
            }
            ["stones", id, photo] => {
                let stone = outline(id)?;
                // One at a time: a photo takes a hundred megabytes.
                let _one = locked(&self.photo);
                sighting(epoch, &stone, &self.place, number(photo)?).map_err(|e| failed(&e))?
            }
            _ => None,
        };
        let jpeg = jpeg.ok_or_else(unknown)?;
        Ok(Response::new(200, "image/jpeg", Body::Bytes(jpeg.into())))
    }

    fn remarks(&self) -> Answer {
        let shown = remarks::shown(&self.place.results).map_err(|e| failed(&e))?;
        Ok(Response::json(200, &shown))
    }

    /// Changes what is said of the results.
    fn say(&self, change: impl FnOnce(&Path) -> stonewise::Result<()>) -> Answer {
        change(&self.place.results).map_err(|e| failed(&e))?;
        self.run.touch();
        self.remarks()
    }

    fn pdf(&self) -> Answer {
        let bytes = remarks::pdf(&self.place.results).map_err(|e| failed(&e))?;
        Ok(Response::new(200, "application/pdf", Body::Bytes(bytes.into())))
    }

    fn project_path(&self) -> Result<&Path, Response> {
        let path = self.place.project.as_deref();
        path.ok_or_else(|| Response::error(404, "the project of these results is gone"))
    }

    fn has_project(&self) -> bool {
        self.place.project.as_deref().is_some_and(Path::is_file)
    }

    fn project_text(&self) -> Result<(PathBuf, String), Response> {
        let path = self.project_path()?;
        let text = std::fs::read_to_string(path)
            .map_err(|e| Response::error(404, &format!("no project file: {}: {e}", path.display())))?;
        Ok((path.to_path_buf(), text))
    }

    fn read_project(&self) -> Result<Project, Response> {
        let (path, text) = self.project_text()?;
        Ok(project_text::check(&path, &text)?)
    }

    fn state(&self) -> State {
        let changed = |path: &Path| path.metadata().and_then(|m| m.modified()).ok();
        let version = |path: &Path| {
            let since = changed(path)?.duration_since(UNIX_EPOCH).ok()?;
            Some(since.as_nanos().to_string())
        };
        let results = &self.place.results;
        let report = results.join(PairFile::ReportPage.place(1));
        let written = changed(&results.join(RUN));
        let project = self.place.project.as_deref();
        let inputs = project
            .into_iter()
            .map(Path::to_path_buf)
            .chain(self.edits_path().ok());
        let run = self.run.shown().0;
        let is_newer = |path: PathBuf| written.is_some() && changed(&path) > written;
        State {
            view: self.guard.is_view() || self.guard.is_read_only(),
            read_only: self.guard.is_read_only(),
            project_file: project.map(|p| p.display().to_string()),
            results_folder: results.display().to_string(),
            has_project: self.has_project(),
            report: version(&report),
            offer: self.place.survey().and_then(|s| version(&teaching::offer_of(s))),
            is_outdated: inputs.into_iter().any(is_newer),
            elsewhere: if run.phase.is_at_work() {
                None
            } else {
                unfinished(results)
            },
            run,
            check: locked(&self.look).shown.clone(),
            project_version: project.and_then(version).unwrap_or_default(),
        }
    }

    /// A stream of states, one at every change.
    fn events(self: &Arc<Self>) -> Answer {
        if self.pages.open.fetch_add(1, Ordering::SeqCst) >= WATCHERS {
            self.pages.open.fetch_sub(1, Ordering::SeqCst);
            return Err(Response::error(409, "too many pages are open"));
        }
        let page = OpenPage(Arc::clone(self));
        let stream = move |out: &mut dyn Write| -> io::Result<()> {
            let api = &page.0;
            loop {
                let (_, version) = api.run.shown();
                let json = serde_json::to_string(&api.state()).map_err(io::Error::other)?;
                out.write_all(format!("data: {json}\n\n").as_bytes())?;
                out.flush()?;
                thread::sleep(EVENTS.0);
                api.run.wait(version, EVENTS.1);
            }
        };
        Ok(Response::new(
            200,
            "text/event-stream",
            Body::Stream(Box::new(stream)),
        ))
    }

    fn project_shown(&self) -> ProjectShown {
        let mut shown = ProjectShown {
            values: Value::Null,
            epochs: Vec::new(),
            stable: Vec::new(),
            mistake: None,
            proposal: None,
        };
        let Ok(path) = self.project_path() else {
            return shown;
        };
        let Ok((path, text)) = self.project_text() else {
            match path.parent().map(propose) {
                Some(Ok(found)) => {
                    shown.proposal = Some(ProposalShown {
                        text: found.text,
                        lines: found.lines,
                    });
                }
                Some(Err(error)) => shown.mistake = Some(Mistake::new(error.to_string()).into()),
                None => {}
            }
            return shown;
        };
        match project_text::values(&text) {
            Ok(values) => {
                shown.stable = stable::shown(&values, &self.place.results);
                shown.values = values;
            }
            Err(mistake) => shown.mistake = Some(mistake.into()),
        }
        match project_text::check(&path, &text) {
            Ok(project) => shown.epochs = epochs(&project, &self.place),
            Err(mistake) => shown.mistake = Some(mistake.into()),
        }
        shown
    }

    /// Writes the project file that the folder suggests.
    fn init_project(self: &Arc<Self>) -> Answer {
        let _one = locked(&self.project);
        let folder = self.project_path()?.parent().unwrap_or(Path::new("."));
        stonewise::init(folder).map_err(|e| failed(&e))?;
        self.look_again();
        Ok(Response::json(200, &self.project_shown()))
    }

    fn change_project(self: &Arc<Self>, changes: &ProjectChanges) -> Answer {
        let _one = locked(&self.project);
        self.write_changes(changes)?;
        self.look_again();
        Ok(Response::json(200, &self.project_shown()))
    }

    /// Adds a stable area where a rectangle was drawn on the face.
    fn add_stable(self: &Arc<Self>, new: &NewStable) -> Answer {
        let value = stable::area(&self.place.results, new).map_err(|e| failed(&e))?;
        let _one = locked(&self.project);
        let values = project_text::values(&self.project_text()?.1)?;
        let areas = values.pointer("/registration/stable").and_then(Value::as_array);
        let keys = ["registration", "stable"].map(|key| Step::Key(key.to_owned()));
        let mut way = keys.to_vec();
        way.push(Step::Place(areas.map_or(0, Vec::len)));
        self.write_changes(&ProjectChanges {
            changes: vec![Change { way, value }],
        })?;
        self.look_again();
        Ok(Response::json(200, &self.project_shown()))
    }

    /// Writes the project file with changes, if it is valid with them and names no new file outside the folders.
    fn write_changes(&self, changes: &ProjectChanges) -> Result<(), Response> {
        let (path, old) = self.project_text()?;
        let mut text = old.clone();
        for change in &changes.changes {
            text = project_text::with(&text, &change.way, &change.value)?;
        }
        let project = project_text::check(&path, &text)?;
        let known = project_text::check(&path, &old).map_or(Vec::new(), |p| p.inputs());
        let strange = project
            .inputs()
            .into_iter()
            .find(|i| !known.contains(i) && !self.place.holds(i));
        if let Some(strange) = strange {
            let message = format!(
                "{} lies outside the survey's folder: write it into the project file by hand",
                strange.display()
            );
            return Err(Response::error(403, &message));
        }
        write_text(&path, &text).map_err(|e| failed(&e))
    }

    /// Looks at the survey, in the background, once more where it is being looked at.
    fn look_again(self: &Arc<Self>) {
        let mut look = locked(&self.look);
        if look.shown.is_running {
            look.is_stale = true;
            return;
        }
        if !self.has_project() {
            return;
        }
        look.shown.is_running = true;
        let api = Arc::clone(self);
        let work = move || {
            loop {
                let (shown, page) = api.look();
                let mut look = locked(&api.look);
                let again = std::mem::take(&mut look.is_stale);
                look.shown = CheckShown {
                    is_running: again,
                    ..shown
                };
                look.page = page;
                drop(look);
                api.run.touch();
                if !again {
                    break;
                }
            }
        };
        if thread::Builder::new()
            .name("check".to_owned())
            .spawn(work)
            .is_err()
        {
            look.shown.is_running = false;
        }
    }

    fn look(&self) -> (CheckShown, Option<String>) {
        let mut shown = CheckShown::default();
        let Ok(project) = self.read_project() else {
            return (shown, None);
        };
        let out = self.place.results.parent().unwrap_or(Path::new("."));
        let look = || check(&project, out, Depth::Full, &Silent);
        match catch_unwind(AssertUnwindSafe(look)) {
            Ok(Ok(report)) => {
                let language = project.settings.report.language;
                shown.findings = report.findings.iter().map(|f| finding(f, language)).collect();
                shown.is_done = true;
                (shown, Some(report.page(&project)))
            }
            Ok(Err(error)) => {
                shown.error = Some(error.to_string());
                (shown, None)
            }
            Err(_) => {
                shown.error = Some("the look at the survey failed".to_owned());
                (shown, None)
            }
        }
    }

    /// Starts the run, which takes over whatever earlier ones finished.
    fn start(self: &Arc<Self>) -> Answer {
        let project = self.read_project()?;
        let folder =
            OutputFolder::of_project(&self.place.results, &project, false).map_err(|e| failed(&e))?;
        self.work(Job::Run, move |run| {
            let summary = stonewise::run(&project, &folder, Until::Reported, run)?;
            let language = project.settings.report.language;
            Ok(move |shown: &mut RunShown| {
                let said = |w: &stonewise::Warning| w.text(language);
                shown.doubts = summary.doubts().map(said).collect();
                let skipped = summary.warnings.iter().filter(|w| w.skipped_input && !w.doubt);
                shown.skipped = skipped.map(said).collect();
                shown.sentence = summary.verdict.as_ref().map(|v| v.sentence.clone());
            })
        })
    }

    /// Does something in the background and reports it to the pages; one at a time.
    fn work<T: FnOnce(&mut RunShown)>(
        self: &Arc<Self>,
        job: Job,
        work: impl FnOnce(&Run) -> stonewise::Result<T> + Send + 'static,
    ) -> Answer {
        if !self.run.begin(job) {
            return Err(Response::error(409, "a run is at work already"));
        }
        let api = Arc::clone(self);
        let work = move || match catch_unwind(AssertUnwindSafe(|| work(&api.run))) {
            Ok(Ok(outcome)) => api.run.end(Phase::Done, outcome),
            Ok(Err(Error::Interrupted)) => api.run.end(Phase::Stopped, |_| {}),
            Ok(Err(error)) => api
                .run
                .end(Phase::Failed, |shown| shown.error = Some(error.to_string())),
            Err(_) => api.run.end(Phase::Failed, |shown| {
                shown.error = Some("a defect of stonewise; the lines in the terminal say where".to_owned());
            }),
        };
        if let Err(error) = thread::Builder::new().name("run".to_owned()).spawn(work) {
            self.run
                .end(Phase::Failed, |shown| shown.error = Some(error.to_string()));
        }
        Ok(Response::json(200, &self.state()))
    }

    fn teaching(&self) -> Answer {
        let survey = self.survey()?;
        Ok(Response::json(
            200,
            &teaching::shown(survey).map_err(|e| failed(&e))?,
        ))
    }

    /// Trains the detector on the corrections, beside the results, under their lock.
    fn teach(self: &Arc<Self>, new: &NewTeaching) -> Answer {
        new.check().map_err(|e| failed(&e))?;
        let project = self.read_project()?;
        let (survey, minutes) = (self.survey()?.to_path_buf(), new.minutes);
        let wall = wall_of(&self.place.results).map_err(|e| failed(&e))?;
        let folder =
            OutputFolder::of_project(&self.place.results, &project, false).map_err(|e| failed(&e))?;
        self.work(Job::Teach, move |run| {
            teaching::train((&project, &survey), minutes, &folder, &wall, run)?;
            Ok(|_: &mut RunShown| {})
        })
    }

    /// Has the project use the detector that is offered.
    fn accept_taught(self: &Arc<Self>) -> Answer {
        let survey = self.survey()?;
        let _no_run = OutputFolder::of_results(&self.place.results).map_err(|e| failed(&e))?;
        let _one = locked(&self.project);
        let name = teaching::accept(survey).map_err(|e| failed(&e))?;
        let way = ["segment", "model"].map(|key| Step::Key(key.to_owned()));
        self.write_changes(&ProjectChanges {
            changes: vec![Change {
                way: way.to_vec(),
                value: name.into(),
            }],
        })?;
        teaching::close(survey).map_err(|e| failed(&e))?;
        self.look_again();
        self.teaching()
    }

    /// Does without the detector that is offered.
    fn close_offer(&self) -> Answer {
        let survey = self.survey()?;
        let _no_run = OutputFolder::of_results(&self.place.results).map_err(|e| failed(&e))?;
        teaching::close(survey).map_err(|e| failed(&e))?;
        self.run.touch();
        self.teaching()
    }

    /// The folder of the project file, in which detectors lie that were taught.
    fn survey(&self) -> Result<&Path, Response> {
        let survey = self.place.survey();
        let survey = survey.ok_or_else(|| Response::error(404, "the project of these results is gone"))?;
        let folder = teaching::folder_of(survey);
        match folder.exists() && !self.place.holds(&folder) {
            true => {
                let message = format!("{} lies outside the survey's folder", folder.display());
                Err(Response::error(403, &message))
            }
            false => Ok(survey),
        }
    }

    /// The file of edits that the project names, else the usual one beside it.
    fn edits_path(&self) -> Result<PathBuf, Response> {
        let (path, text) = self.project_text()?;
        let folder = path.parent().unwrap_or(Path::new("."));
        let values = project_text::values(&text).unwrap_or_default();
        let named = values.pointer("/edits/file").and_then(Value::as_str);
        Ok(folder.join(named.unwrap_or(EDITS_FILE)))
    }

    fn edits(&self) -> Result<EditsShown, Response> {
        if !self.has_project() {
            return Ok(EditsShown::default());
        }
        let path = self.edits_path()?;
        let mut journal = locked(&self.journal);
        if self.guard.is_view() || (journal.is_none() && !path.exists()) {
            let edits = match path.exists() {
                true => EditsFile::read(&path).map_err(|e| failed(&e))?.edits,
                false => Vec::new(),
            };
            return Ok(EditsShown {
                edits,
                can_undo: false,
                can_redo: false,
            });
        }
        Ok(shown(opened(&mut journal, &path)?))
    }

    /// Adds edits: on the disk before it is answered.
    fn add_edits(&self, new: NewEdits) -> Answer {
        let project = self.read_project()?;
        let names: Vec<&str> = project.epochs.iter().map(|e| e.name.as_str()).collect();
        let now = Timestamp::now().to_string();
        let mut edits = new.edits;
        for edit in &mut edits {
            if edit.when.is_empty() {
                edit.when.clone_from(&now);
            }
            check_edit(edit, &names)?;
        }
        if edits.is_empty() {
            return Err(Mistake::new("no edit").into());
        }
        let results = &self.place.results;
        let facade = || Ok(ResultSet::read_measured(results, 1)?.facade);
        self.with_journal(&new.id, |journal, id| journal.add(id, edits, facade))
    }

    fn act(&self, act: &Act, do_it: impl FnOnce(&mut Journal, &str) -> stonewise::Result<bool>) -> Answer {
        self.with_journal(&act.id, do_it)
    }

    fn with_journal(
        &self,
        id: &str,
        do_it: impl FnOnce(&mut Journal, &str) -> stonewise::Result<bool>,
    ) -> Answer {
        if id.is_empty() || id.len() > LONGEST_ID {
            return Err(Mistake::new("an act needs a name of its own (id)").into());
        }
        let _one = locked(&self.project);
        let path = self.edits_path()?;
        if !path.parent().is_some_and(|folder| self.place.holds(folder))
            || (path.exists() && !self.place.holds(&path))
        {
            let message = format!("{} lies outside the survey's folder", path.display());
            return Err(Response::error(403, &message));
        }
        let mut journal = locked(&self.journal);
        let journal = opened(&mut journal, &path)?;
        do_it(journal, id).map_err(|e| failed(&e))?;
        let answer = shown(journal);
        self.name_edits(&path)?;
        self.run.touch();
        Ok(Response::json(200, &answer))
    }

    /// Has the project file name the file of edits.
    fn name_edits(&self, path: &Path) -> Result<(), Response> {
        let (_, text) = self.project_text()?;
        let is_named = project_text::values(&text)?.pointer("/edits/file").is_some();
        if is_named || !path.exists() {
            return Ok(());
        }
        let way = ["edits", "file"].map(|key| Step::Key(key.to_owned()));
        let change = Change {
            way: way.to_vec(),
            value: EDITS_FILE.into(),
        };
        self.write_changes(&ProjectChanges {
            changes: vec![change],
        })
    }
}

fn opened<'a>(journal: &'a mut Option<Journal>, path: &Path) -> Result<&'a mut Journal, Response> {
    // The project may name another file meanwhile.
    let fresh = match journal.take() {
        Some(open) if open.file() == path => open,
        _ => Journal::open(path).map_err(|e| failed(&e))?,
    };
    Ok(journal.insert(fresh))
}

fn shown(journal: &Journal) -> EditsShown {
    EditsShown {
        edits: journal.edits(),
        can_undo: journal.can_undo(),
        can_redo: journal.can_redo(),
    }
}

fn check_edit(edit: &Edit, epochs: &[&str]) -> Result<(), Response> {
    let named = edit.epoch.iter().chain(edit.epochs.iter().flatten());
    let unknown = named.into_iter().find(|name| !epochs.contains(&name.as_str()));
    let mistake = unknown
        .map(|name| format!("no epoch {name:?}"))
        .or_else(|| edit.mistake());
    mistake.map_or(Ok(()), |message| Err(Mistake::new(message).into()))
}

fn finding(finding: &Finding, language: Language) -> FindingShown {
    FindingShown {
        epoch: finding.epoch.clone(),
        weight: match finding.verdict {
            Verdict::Fine => Weight::Fine,
            Verdict::Note => Weight::Note,
            Verdict::Doubt => Weight::Doubt,
            Verdict::Wrong => Weight::Wrong,
            Verdict::Unreadable => Weight::Unreadable,
        },
        text: finding.said().text(language).to_owned(),
    }
}

fn unknown() -> Response {
    Response::error(404, "nothing is here")
}

/// The body of a request.
fn body<T: DeserializeOwned>(request: &Request) -> Result<T, Response> {
    serde_json::from_slice(&request.body)
        .map_err(|e| Response::error(400, &format!("the body cannot be read: {e}")))
}
