//! The rules of the house that a program can check, read off the source itself.
//!
//! Six floors, arrows only point down, and a leaf beside them; rayon in `control` only; no clock, log or sleep
//! below `service`; files and functions of a size that fits a head; nothing that panics on purpose outside tests; no
//! circle of files that name each other; words that are no names, and one type for each name.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Lowest first. The binary (`main.rs` and `command/`) stands on top and names the library as `ballast`.
const FLOORS: [&str; 6] = ["numerics", "control", "returns", "store", "service", "http"];
/// The place of `service` among them.
const SERVICE: usize = 4;
/// Parts of `control` behind its face, which only that floor names: how a robust step is solved.
const BEHIND_THE_FACE: [&str; 3] = ["bellman", "surrogate", "uncertainty"];
/// Files of `control` whose types users send or read as they are, and which therefore describe themselves to the API. A
/// copy of each for the API alone would be a second place for every field and every sentence about it. What computes is not
/// among them: nothing of `numerics`, and of `control` neither the method nor the problem.
const DOCUMENTS: [&str; 48] = [
    "control/assets/advice.rs",
    "control/evaluation/assets/report.rs",
    "control/evaluation/backtest_report.rs",
    "control/evaluation/declared_comparison.rs",
    "control/evaluation/declared_walk.rs",
    "control/evaluation/frontier/report.rs",
    "control/evaluation/names.rs",
    "control/evaluation/plan/report.rs",
    "control/evaluation/report.rs",
    "control/policy/advice.rs",
    "control/policy/caution.rs",
    "control/policy/declared.rs",
    "control/policy/futures/report.rs",
    "control/policy/levels.rs",
    "control/policy/sensitivity/mod.rs",
    "control/policy/surface.rs",
    "control/policy/worst_case.rs",
    "control/posed.rs",
    "control/progress.rs",
    "control/request/annualised.rs",
    "control/request/assets.rs",
    "control/request/backtest.rs",
    "control/request/backtest_assets.rs",
    "control/request/caution.rs",
    "control/request/centre.rs",
    "control/request/contributions.rs",
    "control/request/declared.rs",
    "control/request/declared_backtest.rs",
    "control/request/declared_comparison.rs",
    "control/request/evaluation.rs",
    "control/request/framework.rs",
    "control/request/frontier.rs",
    "control/request/learning.rs",
    "control/request/own_weights.rs",
    "control/request/plan.rs",
    "control/request/limits.rs",
    "control/request/means.rs",
    "control/request/radius_rule.rs",
    "control/request/sampling_law.rs",
    "control/request/fund.rs",
    "control/request/sleeve.rs",
    "control/request/specification.rs",
    "control/request/spending.rs",
    "control/request/support.rs",
    "control/request/terms.rs",
    "control/request/warnings.rs",
    "control/sleeve/report.rs",
    "control/solved_step.rs",
];
/// Names no floor and is named by none below `service`: what mathematics and facts look like is not their matter.
const LEAF: &str = "report";
const FILE_LINES: usize = 350;
const FUNCTION_LINES: usize = 70;

/// Files above `FILE_LINES`, and why.
const LONG_FILES: [(&str, &str); 0] = [];
/// Functions above `FUNCTION_LINES` as `file: function`, and why.
const LONG_FUNCTIONS: [(&str, &str); 0] = [];

/// Calls that read the clock, log, print or sleep; they enter the lower floors as arguments or not at all.
const EFFECTS: [&str; 9] = [
    "Instant::now",
    "SystemTime::now",
    "println!",
    "eprintln!",
    "print!",
    "dbg!",
    "tracing::",
    "thread::sleep",
    "time::sleep",
];
const PANICS: [&str; 4] = [".unwrap()", "panic!", "todo!", "unimplemented!"];

/// No identifier is one of these: a name says what the value is, not how it came about.
const BANNED_NAMES: [&str; 6] = ["told", "said", "asked", "taken", "stood", "given_back"];
/// No doc comment begins with one of these: its first sentence would have no subject.
const BANNED_OPENINGS: [&str; 5] = ["Of", "The same", "What", "Whether", "Where"];

/// A file of `src`, with comments, literals and tests blanked out, line for line.
struct Source {
    /// Relative to `src`, with `/` between folders.
    path: String,
    code: String,
    /// The first line of every doc comment, also in tests, with its number.
    openings: Vec<(usize, String)>,
    /// Modules it declares for tests only.
    test_modules: Vec<String>,
}

impl Source {
    fn new(path: &str, text: &str) -> Self {
        let mut code = blank_comments_and_literals(text);
        let test_modules = blank_tests(&mut code);
        Source { path: path.into(), code, openings: openings(text), test_modules }
    }

    /// The first part of its path: a floor, the leaf, or part of the binary.
    fn top(&self) -> &str {
        self.path.split(['/', '.']).next().unwrap_or_default()
    }

    fn floor(&self) -> Option<usize> {
        FLOORS.iter().position(|floor| *floor == self.top())
    }

    fn line_of(&self, offset: usize) -> usize {
        1 + self.code[..offset].matches('\n').count()
    }

    fn lines(&self) -> usize {
        self.code.trim_end().lines().count()
    }

    /// Paths of the files that hold its test modules.
    fn test_files(&self) -> Vec<String> {
        let (folder, file) = self.path.rsplit_once('/').unwrap_or(("", &self.path));
        let stem = file.trim_end_matches(".rs");
        let below = if matches!(stem, "mod" | "lib" | "main") { folder.into() } else { join(folder, stem) };
        let paths = |name: &String| [join(&below, &format!("{name}.rs")), join(&below, &format!("{name}/mod.rs"))];
        self.test_modules.iter().flat_map(paths).collect()
    }

    /// Every function as name and line span.
    fn functions(&self) -> Vec<(String, Range<usize>)> {
        words(&self.code, "fn").filter_map(|at| self.function(at)).collect()
    }

    /// Every type as name and line; associated types are the trait's, and are not among them.
    fn types(&self) -> Vec<(String, usize)> {
        let at = |keyword: &'static str| words(&self.code, keyword).map(move |at| (keyword, at));
        let declared = |(keyword, at): (&str, usize)| {
            let name = first_word(&self.code[at + keyword.len()..]);
            let is_item = keyword != "type" || is_at_the_top(&self.code[..at]);
            (is_item && name.starts_with(char::is_uppercase)).then(|| (name, self.line_of(at)))
        };
        ["struct", "enum", "trait", "type"].into_iter().flat_map(at).filter_map(declared).collect()
    }

    fn function(&self, at: usize) -> Option<(String, Range<usize>)> {
        let rest = &self.code[at + 2..];
        let name: String = rest.trim_start().chars().take_while(|&letter| is_word(letter)).collect();
        if name.is_empty() {
            return None; // a function pointer type
        }
        let end = at + 2 + item_end(rest);
        self.code[..end].ends_with('}').then(|| (name, self.line_of(at)..self.line_of(end) + 1))
    }
}

/// Returns true if every brace opened before is closed.
fn is_at_the_top(before: &str) -> bool {
    before.matches('{').count() == before.matches('}').count()
}

/// The first line of every doc comment of a text, without its slashes.
fn openings(text: &str) -> Vec<(usize, String)> {
    let comment = |line: &str| {
        let line = line.trim_start();
        ["///", "//!"].iter().find_map(|mark| line.strip_prefix(mark)).map(|rest| rest.trim().to_owned())
    };
    let comments: Vec<Option<String>> = text.lines().map(comment).collect();
    let begins = |&line: &usize| line == 0 || comments[line - 1].is_none();
    (0..comments.len()).filter(begins).filter_map(|line| Some((line + 1, comments[line].clone()?))).collect()
}

/// The banned opening of a doc comment, as a whole word.
fn banned_opening(comment: &str) -> Option<&'static str> {
    let goes_on = |rest: &str| rest.starts_with(|letter: char| is_word(letter) || letter == '-');
    BANNED_OPENINGS.into_iter().find(|opening| comment.strip_prefix(opening).is_some_and(|rest| !goes_on(rest)))
}

fn join(folder: &str, name: &str) -> String {
    if folder.is_empty() { name.into() } else { format!("{folder}/{name}") }
}

fn is_word(letter: char) -> bool {
    letter.is_alphanumeric() || letter == '_'
}

/// Offsets at which `word` stands as a whole word.
fn words<'a>(code: &'a str, word: &'a str) -> impl Iterator<Item = usize> + 'a {
    code.match_indices(word).map(|(at, _)| at).filter(move |&at| {
        let before = code[..at].chars().next_back().is_some_and(is_word);
        let after = code[at + word.len()..].chars().next().is_some_and(is_word);
        !before && !after
    })
}

/// Length of the item that starts `code`: to its `;`, or to the brace that closes its body.
fn item_end(code: &str) -> usize {
    let mut open: Vec<char> = Vec::new();
    for (at, letter) in code.char_indices() {
        match letter {
            '(' | '[' | '{' => open.push(letter),
            ')' | ']' | '}' => drop(open.pop()),
            _ => {}
        }
        if open.is_empty() && matches!(letter, ';' | '}') {
            return at + 1;
        }
    }
    code.len()
}

/// Blanks comments and the insides of string and character literals; line breaks stay.
fn blank_comments_and_literals(text: &str) -> String {
    let letters: Vec<char> = text.chars().collect();
    let mut out = String::with_capacity(text.len());
    let mut at = 0;
    while at < letters.len() {
        let end = literal_end(&letters, at);
        if end == at {
            out.push(letters[at]);
            at += 1;
            continue;
        }
        out.extend(letters[at..end].iter().map(|&letter| if letter == '\n' { '\n' } else { ' ' }));
        at = end;
    }
    out
}

/// Returns where the comment or literal that starts at `at` ends; `at` itself if none starts.
fn literal_end(letters: &[char], at: usize) -> usize {
    let rest = &letters[at..];
    let inside_word = at > 0 && is_word(letters[at - 1]);
    let length = match rest {
        ['/', '/', ..] => rest.iter().position(|&letter| letter == '\n').unwrap_or(rest.len()),
        ['/', '*', ..] => block_comment_length(rest),
        ['"', ..] => quoted_length(rest),
        ['r', '"' | '#', ..] if !inside_word => raw_length(&rest[1..]).map_or(0, |length| length + 1),
        ['b', 'r', '"' | '#', ..] if !inside_word => raw_length(&rest[2..]).map_or(0, |length| length + 2),
        ['\'', '\\', ..] => 3 + rest[3..].iter().position(|&letter| letter == '\'').map_or(0, |end| end + 1),
        ['\'', _, '\'', ..] => 3,
        _ => 0,
    };
    at + length
}

fn block_comment_length(rest: &[char]) -> usize {
    let mut depth = 0;
    let mut at = 0;
    while at + 1 < rest.len() {
        match (rest[at], rest[at + 1]) {
            ('/', '*') => depth += 1,
            ('*', '/') => depth -= 1,
            _ => {
                at += 1;
                continue;
            }
        }
        at += 2;
        if depth == 0 {
            return at;
        }
    }
    rest.len()
}

fn quoted_length(rest: &[char]) -> usize {
    let mut at = 1;
    while at < rest.len() {
        match rest[at] {
            '\\' => at += 2,
            '"' => return at + 1,
            _ => at += 1,
        }
    }
    rest.len()
}

/// Length of a raw string after its `r`; `None` for a raw identifier.
fn raw_length(rest: &[char]) -> Option<usize> {
    let hashes = rest.iter().take_while(|&&letter| letter == '#').count();
    if rest.get(hashes) != Some(&'"') {
        return None;
    }
    let closing: Vec<char> = std::iter::once('"').chain(std::iter::repeat_n('#', hashes)).collect();
    let body = &rest[hashes + 1..];
    let end = body.windows(closing.len()).position(|window| window == closing);
    Some(end.map_or(rest.len(), |end| hashes + 1 + end + closing.len()))
}

/// Blanks every item under `#[cfg(test)]`; the names of the modules among them that live in files of their own.
fn blank_tests(code: &mut String) -> Vec<String> {
    const ATTRIBUTE: &str = "#[cfg(test)]";
    let mut modules = Vec::new();
    while let Some(start) = code.find(ATTRIBUTE) {
        let after = start + ATTRIBUTE.len();
        let end = after + item_end(&code[after..]);
        let item = code[after..end].trim();
        if let Some(name) = item.strip_suffix(';').and_then(|item| item.split("mod ").nth(1)) {
            modules.push(name.trim().into());
        }
        let blank: String = code[start..end].chars().map(|letter| if letter == '\n' { '\n' } else { ' ' }).collect();
        code.replace_range(start..end, &blank);
    }
    modules
}

/// First segments of every path that starts at the crate's root, with their offsets; groups are opened.
fn crate_paths(code: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    for at in words(code, "crate") {
        let Some(rest) = code[at + 5..].trim_start().strip_prefix("::") else { continue };
        let rest = rest.trim_start();
        let names = if rest.starts_with('{') { top_of_group(rest) } else { vec![first_word(rest)] };
        found.extend(names.into_iter().map(|name| (at, name)));
    }
    found
}

fn first_word(text: &str) -> String {
    text.trim_start().chars().take_while(|&letter| is_word(letter)).collect()
}

/// `{a::b, c::{d, e}}` gives a, c.
fn top_of_group(group: &str) -> Vec<String> {
    let mut names = Vec::new();
    let mut depth = 0;
    for (at, letter) in group.char_indices() {
        match letter {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' => {}
            _ => continue,
        }
        if depth == 0 {
            break;
        }
        if depth == 1 && letter != '}' {
            names.push(first_word(&group[at + 1..]));
        }
    }
    names.retain(|name| !name.is_empty());
    names
}

/// Every path of `code` that starts at the crate's root, at the module or at one above it; groups are opened.
fn module_paths(code: &str) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    for root in ["crate", "ballast", "self", "super"] {
        for at in words(code, root) {
            if !code[..at].trim_end().ends_with("::") {
                open_path(Vec::new(), &code[at..], &mut found);
            }
        }
    }
    found
}

/// Adds the paths that `text` starts with, each after `before`.
fn open_path(mut before: Vec<String>, text: &str, found: &mut Vec<Vec<String>>) {
    let text = text.trim_start();
    if let Some(group) = text.strip_prefix('{') {
        let mut start = 0;
        let mut depth = 0;
        for (at, letter) in group.char_indices() {
            match letter {
                '{' => depth += 1,
                '}' | ',' if depth == 0 => {
                    if !group[start..at].trim().is_empty() {
                        open_path(before.clone(), &group[start..at], found);
                    }
                    start = at + 1;
                }
                '}' => depth -= 1,
                _ => {}
            }
            if letter == '}' && start == at + 1 {
                return;
            }
        }
        return;
    }
    let word = first_word(text);
    before.push(word.clone());
    match text[word.len()..].trim_start().strip_prefix("::") {
        Some(rest) if !word.is_empty() => open_path(before, rest, found),
        _ => found.push(before),
    }
}

/// The module that a file holds: its folders and its name.
fn module_of(path: &str) -> Vec<String> {
    let mut parts: Vec<String> = path.trim_end_matches(".rs").split('/').map(str::to_owned).collect();
    if parts.last().is_some_and(|last| matches!(last.as_str(), "mod" | "lib" | "main")) {
        parts.pop();
    }
    parts
}

/// Files that each file names. A module and the ones inside it may name each other: they are one thing in several files.
fn imports(sources: &[Source]) -> BTreeMap<&str, BTreeSet<&str>> {
    let files: BTreeMap<Vec<String>, &str> =
        sources.iter().map(|source| (module_of(&source.path), source.path.as_str())).collect();
    let of = |source: &Source| {
        let own = module_of(&source.path);
        let named = |path: Vec<String>| {
            let steps = path.iter().take_while(|part| matches!(part.as_str(), "super" | "self" | "crate" | "ballast"));
            let (roots, rest) = path.split_at(steps.count());
            let up = roots.iter().filter(|root| *root == "super").count();
            let from_root = roots.iter().any(|root| matches!(root.as_str(), "crate" | "ballast"));
            let mut module = if from_root { Vec::new() } else { own[..own.len().saturating_sub(up)].to_vec() };
            module.extend_from_slice(rest);
            (0..=module.len()).rev().find_map(|length| files.get_key_value(&module[..length]))
        };
        let apart = |(module, _): &(&Vec<String>, &&str)| !module.starts_with(&own) && !own.starts_with(module);
        module_paths(&source.code).into_iter().filter_map(named).filter(apart).map(|(_, path)| *path).collect()
    };
    sources.iter().map(|source| (source.path.as_str(), of(source))).collect()
}

/// Groups of files of which each leads to each of the others.
fn circles(imports: &BTreeMap<&str, BTreeSet<&str>>) -> BTreeSet<String> {
    let reached: BTreeMap<&str, BTreeSet<&str>> = imports.keys().map(|file| (*file, reached(file, imports))).collect();
    let together = |file: &str| {
        let group = reached[file].iter().filter(|other| reached[**other].contains(file));
        group.copied().collect::<Vec<&str>>().join(" ")
    };
    reached.keys().filter(|file| reached[**file].contains(**file)).map(|file| together(file)).collect()
}

/// The files that `start` leads to.
fn reached<'a>(start: &'a str, imports: &BTreeMap<&str, BTreeSet<&'a str>>) -> BTreeSet<&'a str> {
    let (mut reached, mut open) = (BTreeSet::new(), vec![start]);
    while let Some(file) = open.pop() {
        let next = imports.get(file).into_iter().flatten();
        open.extend(next.filter(|next| reached.insert(**next)).copied());
    }
    reached
}

/// Every broken rule of one file, as `file:line: what`.
fn faults(source: &Source) -> Vec<String> {
    let mut faults = Vec::new();
    let mut fault = |at: usize, what: String| faults.push(format!("{}:{}: {what}", source.path, source.line_of(at)));
    let (own, is_leaf) = (source.floor(), source.top() == LEAF);
    if own.is_some() || is_leaf {
        for (at, name) in crate_paths(&source.code) {
            let named = FLOORS.iter().position(|floor| *floor == name);
            if named > own {
                fault(at, format!("{} names the higher floor {name}", source.top()));
            }
            if name == LEAF && own.is_some_and(|own| own < SERVICE) {
                fault(at, format!("{} names the leaf {name}", source.top()));
            }
        }
        let modules = module_paths(&source.code).into_iter().filter(|_| source.top() != "control");
        for path in modules.filter(|path| path.len() > 2 && path[..2] == ["crate", "control"]) {
            if BEHIND_THE_FACE.contains(&path[2].as_str()) {
                fault(0, format!("{} names control::{}, which lies behind its face", source.top(), path[2]));
            }
        }
        for at in words(&source.code, "ballast") {
            fault(at, "a floor names the crate as `crate`".into());
        }
        let pure = is_leaf || own < Some(SERVICE);
        for call in EFFECTS.iter().filter(|_| pure) {
            source.code.match_indices(call).for_each(|(at, _)| fault(at, format!("{call} below service")));
        }
    }
    if matches!(source.top(), "numerics" | "control") && !DOCUMENTS.contains(&source.path.as_str()) {
        words(&source.code, "utoipa").for_each(|at| fault(at, "what computes describes nothing for the API".into()));
    }
    if !source.path.starts_with("control/") {
        words(&source.code, "rayon").for_each(|at| fault(at, "rayon outside control".into()));
    }
    for call in PANICS {
        source.code.match_indices(call).for_each(|(at, _)| fault(at, format!("{call} outside tests")));
    }
    for name in BANNED_NAMES {
        words(&source.code, name).for_each(|at| fault(at, format!("{name} is no name")));
    }
    if source.lines() > FILE_LINES && !is_listed(&LONG_FILES, &source.path) {
        fault(0, format!("{} lines without tests, above {FILE_LINES}", source.lines()));
    }
    for (name, lines) in source.functions() {
        let listed = is_listed(&LONG_FUNCTIONS, &format!("{}: {name}", source.path));
        if lines.len() > FUNCTION_LINES && !listed {
            faults.push(format!("{}:{}: {name} has {} lines", source.path, lines.start, lines.len()));
        }
    }
    for (line, comment) in &source.openings {
        if let Some(opening) = banned_opening(comment) {
            faults.push(format!("{}:{line}: a doc comment begins with {opening:?}", source.path));
        }
    }
    faults
}

/// Names that stand for more than one type, with their places.
fn names_of_several_types<'a>(sources: impl Iterator<Item = &'a Source>) -> Vec<String> {
    let mut places: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for source in sources {
        for (name, line) in source.types() {
            places.entry(name).or_default().push(format!("{}:{line}", source.path));
        }
    }
    let several = places.into_iter().filter(|(_, places)| places.len() > 1);
    several.map(|(name, places)| format!("{name}: {}", places.join(", "))).collect()
}

fn is_listed(exceptions: &[(&str, &str)], name: &str) -> bool {
    exceptions.iter().any(|(listed, _)| *listed == name)
}

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            found.push(path);
        }
    }
}

/// Every file of a folder, by its path from `root`.
fn sources_of(root: &str, folder: &str) -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join(root);
    let mut paths = Vec::new();
    rust_files(&root.join(folder), &mut paths);
    let read = |path: &PathBuf| {
        let name = path.strip_prefix(&root).unwrap().to_string_lossy().replace('\\', "/");
        Source::new(&name, &fs::read_to_string(path).unwrap())
    };
    paths.iter().map(read).collect()
}

fn sources() -> Vec<Source> {
    sources_of("src", "")
}

/// Files reached from the crate roots by their `mod` declarations, as the compiler reaches them.
fn declared_files(sources: &[Source]) -> BTreeSet<String> {
    let exists = |path: &String| sources.iter().any(|source| source.path == *path);
    let mut files: BTreeSet<String> = ["lib.rs".into(), "main.rs".into()].into();
    for source in sources {
        let names =
            words(&source.code, "mod").filter(|&at| source.code[at..at + item_end(&source.code[at..])].ends_with(';'));
        let test_modules =
            names.map(|at| first_word(&source.code[at + 3..])).chain(source.test_modules.clone()).collect();
        let declares = Source { path: source.path.clone(), code: String::new(), openings: Vec::new(), test_modules };
        files.extend(declares.test_files().into_iter().filter(exists));
    }
    files
}

#[test]
fn every_floor_says_its_number_and_the_readme_agrees() {
    let read = |path: &str| fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap();
    let readme = read("README.md");
    for (number, floor) in FLOORS.into_iter().enumerate() {
        let head = read(&format!("src/{floor}/mod.rs"));
        assert!(head.starts_with(&format!("//! Floor {number}: ")), "{floor}");
        assert!(readme.contains(&format!("| {number} | `src/{floor}/` |")), "{floor}");
    }
}

#[test]
fn the_source_keeps_the_rules_of_the_house() {
    let sources = sources();
    let visited: BTreeSet<String> = sources.iter().map(|source| source.path.clone()).collect();
    assert_eq!(visited, declared_files(&sources), "files visited, and files the crate is made of");
    for floor in FLOORS.into_iter().chain([LEAF]) {
        assert!(visited.contains(&format!("{floor}/mod.rs")), "floor {floor} was not visited");
    }
    assert!(DOCUMENTS.iter().all(|file| visited.contains(*file)), "a document is no file");
    let tests: BTreeSet<String> = sources.iter().flat_map(Source::test_files).collect();
    let lab = sources_of("", "lab/src");
    assert!(lab.len() > 20, "{} files of the lab", lab.len());
    let kept = sources.iter().filter(|source| !tests.contains(&source.path)).chain(&lab);
    let faults: Vec<String> = kept.flat_map(faults).collect();
    assert!(faults.is_empty(), "{} broken rules:\n{}", faults.len(), faults.join("\n"));
}

#[test]
fn no_doc_comment_of_a_test_begins_without_a_subject() {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    let (mut paths, mut read) = (Vec::new(), 0);
    rust_files(&tests, &mut paths);
    for path in paths {
        for (line, comment) in openings(&fs::read_to_string(&path).unwrap()) {
            assert_eq!(banned_opening(&comment), None, "{}:{line}: {comment}", path.display());
            read += 1;
        }
    }
    assert!(read > 500, "{read} doc comments");
}

#[test]
fn a_type_name_stands_for_one_type() {
    let sources = sources();
    assert!(sources.iter().map(|source| source.types().len()).sum::<usize>() > 400, "the types were not read");
    let tests: BTreeSet<String> = sources.iter().flat_map(Source::test_files).collect();
    let several = names_of_several_types(sources.iter().filter(|source| !tests.contains(&source.path)));
    assert!(several.is_empty(), "names of several types:\n{}", several.join("\n"));
}

#[test]
fn a_name_of_two_types_is_found_and_an_associated_type_is_none() {
    let several = |files: &[(&str, &str)]| {
        let sources: Vec<Source> = files.iter().map(|(path, text)| Source::new(path, text)).collect();
        names_of_several_types(sources.iter())
    };
    let (a, b) = ("control/a.rs", "store/b.rs");
    let state = "pub struct State;\n";
    assert_eq!(several(&[(a, state), (b, "\nenum State { On }")]), ["State: control/a.rs:1, store/b.rs:2"]);
    assert_eq!(several(&[(a, state), (b, "type State = u8;")]).len(), 1);
    assert_eq!(several(&[(a, state), (b, "fn f() { struct State; }")]).len(), 1);
    assert_eq!(several(&[(a, state), (b, "impl T for A { type State = super::State; }")]), [""; 0]);
    assert_eq!(several(&[(a, state), (b, "#[cfg(test)]\nmod tests { struct State; }")]), [""; 0]);
    assert_eq!(several(&[(a, state), (b, "trait T { type State; }\n/// A struct State.\nstruct B;")]), [""; 0]);
}

#[test]
fn no_files_name_each_other_in_a_circle() {
    let sources = sources();
    let imports = imports(&sources);
    assert!(imports.values().map(BTreeSet::len).sum::<usize>() > 500, "the imports were not read");
    let circles: Vec<String> = circles(&imports).into_iter().collect();
    assert!(circles.is_empty(), "circles of imports:\n{}", circles.join("\n"));
}

#[test]
fn a_circle_is_found_and_a_parent_and_its_child_are_none() {
    let circles_of = |files: &[(&str, &str)]| {
        let sources: Vec<Source> = files.iter().map(|(path, text)| Source::new(path, text)).collect();
        circles(&imports(&sources)).into_iter().collect::<Vec<String>>()
    };
    let (a, b) = ("control/a.rs", "control/b.rs");
    assert_eq!(
        circles_of(&[(a, "use super::b::B;"), (b, "fn f() -> crate::control::a::A { g() }")]),
        ["control/a.rs control/b.rs"]
    );
    assert_eq!(circles_of(&[(a, "use crate::{control::{b::{B, C}}, numerics::gp};"), (b, "use super::a;")]).len(), 1);
    assert_eq!(circles_of(&[(a, "use super::b::B;"), (b, "use crate::numerics::gp;")]), [""; 0]);
    assert_eq!(
        circles_of(&[(a, "use super::b::B;"), (b, "#[cfg(test)]\nmod tests { use super::super::a; }")]),
        [""; 0]
    );
    let three = [(a, "use super::b::B;"), (b, "use super::c;"), ("control/c.rs", "use super::a::A;")];
    assert_eq!(circles_of(&three), ["control/a.rs control/b.rs control/c.rs"]);
    let family = [("control/a/mod.rs", "mod b; use self::b::B;"), ("control/a/b.rs", "use super::A;")];
    assert_eq!(circles_of(&family), [""; 0]);
}

fn faults_of(path: &str, text: &str) -> Vec<String> {
    faults(&Source::new(path, text))
}

#[test]
fn a_broken_rule_is_found() {
    let upward = "use crate::{numerics::gp, service::{clock, metrics}};\nfn f() -> crate::http::Problem { g() }";
    assert_eq!(
        faults_of("control/policy.rs", upward),
        [
            "control/policy.rs:1: control names the higher floor service",
            "control/policy.rs:2: control names the higher floor http",
        ]
    );
    assert_eq!(faults_of("http/router.rs", upward), [""; 0]);
    let leaf = "use crate::{report::Page, numerics::gp};";
    assert_eq!(faults_of("report/page.rs", leaf), ["report/page.rs:1: report names the higher floor numerics"]);
    assert_eq!(faults_of("store/jobs.rs", leaf), ["store/jobs.rs:1: store names the leaf report"]);
    assert_eq!(faults_of("service/jobs.rs", leaf), [""; 0]);
    let behind = "use crate::control::{bellman::BellmanStep, policy::Policy};";
    assert_eq!(
        faults_of("service/jobs.rs", behind),
        ["service/jobs.rs:1: service names control::bellman, which lies behind its face"]
    );
    assert_eq!(faults_of("control/training.rs", behind), [""; 0]);
    assert_eq!(faults_of("report/page.rs", "fn f() { println!() }").len(), 1);
    assert_eq!(faults_of("numerics/gp.rs", "use rayon::prelude::*;").len(), 1);
    assert_eq!(faults_of("control/policy.rs", "use rayon::prelude::*;").len(), 0);
    assert_eq!(faults_of("control/training.rs", "use utoipa::ToSchema;").len(), 1);
    assert_eq!(faults_of("control/progress.rs", "use utoipa::ToSchema;").len(), 0);
    assert_eq!(faults_of("store/jobs.rs", "fn f() { let now = Instant::now(); }").len(), 1);
    assert_eq!(faults_of("control/backward.rs", "fn f() { std::thread::sleep(PAUSE); }").len(), 1);
    assert_eq!(faults_of("service/process/clock.rs", "fn f() { let now = Instant::now(); }").len(), 0);
    assert_eq!(faults_of("http/a.rs", "fn f() { g().unwrap(); panic!(\"no\"); todo!() }").len(), 3);
    assert_eq!(faults_of("http/a.rs", &format!("fn f(a: [u8; 3]) {{{}}}", "\n".repeat(70))).len(), 1);
    assert_eq!(faults_of("http/a.rs", &format!("fn f(a: [u8; 3]) {{{}}}", "\n".repeat(69))).len(), 0);
    assert_eq!(faults_of("http/a.rs", &"const A: u8 = 1;\n".repeat(351)).len(), 1);
}

#[test]
fn a_banned_name_and_a_banned_opening_are_found() {
    assert_eq!(
        faults_of("http/a.rs", "fn f(told: u8) -> u8 {\n    told\n}"),
        ["http/a.rs:1: told is no name", "http/a.rs:2: told is no name"]
    );
    for name in BANNED_NAMES {
        assert_eq!(faults_of("http/a.rs", &format!("struct A {{ {name}: u8 }}")).len(), 1, "{name}");
        assert_eq!(faults_of("http/a.rs", &format!("// {name}\nconst A: &str = \"{name}\";")), [""; 0]);
        assert_eq!(faults_of("http/a.rs", &format!("fn {name}_by() {{ un{name}() }}")), [""; 0]);
    }
    for opening in BANNED_OPENINGS {
        let found = format!("http/a.rs:2: a doc comment begins with {opening:?}");
        assert_eq!(faults_of("http/a.rs", &format!("\n/// {opening} a law.\nstruct A;")), std::slice::from_ref(&found));
        assert_eq!(faults_of("http/a.rs", &format!("\n//! {opening}: a law.")), [found]);
        assert_eq!(faults_of("http/a.rs", &format!("// {opening} a law.\n/// A law.\n/// {opening} it.")), [""; 0]);
    }
    let found = faults_of("http/a.rs", "#[cfg(test)]\nmod tests {\n    /// Where it is.\n    const A: u8 = 1;\n}");
    assert_eq!(found, ["http/a.rs:3: a doc comment begins with \"Where\""]);
    assert_eq!(faults_of("http/a.rs", "/// Often.\nstruct A;\n/// What-if questions.\nstruct B;"), [""; 0]);
}

#[test]
fn comments_literals_and_tests_break_no_rule() {
    let innocent = r##"
        // crate::http, panic!
        /* .unwrap() /* nested todo!() */ rayon */
        const A: &str = "crate::http \" panic!";
        const B: &str = r#"todo!() " rayon"#;
        const C: [char; 3] = ['"', '\'', '\u{22}'];
        fn f<'a>(r: &'a str) -> &'a str { r }
        #[cfg(test)]
        mod tests { fn g() { crate::http::f().unwrap(); } }
        #[cfg(test)]
        mod story;
    "##;
    let source = Source::new("control/bellman.rs", innocent);
    assert_eq!(faults(&source), [""; 0]);
    assert_eq!(source.test_files(), ["control/bellman/story.rs", "control/bellman/story/mod.rs"]);
    let functions: Vec<String> = source.functions().into_iter().map(|(name, _)| name).collect();
    assert_eq!(functions, ["f"]);
    assert_eq!(faults_of("control/bellman.rs", &format!("{innocent}\nuse crate::http;")).len(), 1);
}

#[test]
fn no_unsafe_code_is_allowed_anywhere() {
    for root in ["src/lib.rs", "src/main.rs", "lab/src/main.rs"] {
        let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(root)).unwrap();
        assert!(text.lines().any(|line| line == "#![forbid(unsafe_code)]"), "{root}");
    }
}
