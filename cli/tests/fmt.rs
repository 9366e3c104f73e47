//! `isograd fmt`: what it writes and where, what it leaves alone, and the way from the 2024 dialect.

mod common;

use common::Dir;

const UGLY: &str = "export fn f(x:real)->real{\r\nx*2.0   // twice\r\n}";
const PRETTY: &str = "export fn f(x: real) -> real {\n    x * 2.0 // twice\n}\n";
const WRONG: &str = "export fn f(x:real)->real{ x + }\n";
const OLD: &str = "module part;\nexport f(x: s) { part(x) }\n";
const NEW: &str = "module self::part;\nexport fn f(x: real) -> real { part(x) }\n";

fn text(dir: &Dir, name: &str) -> String {
    std::fs::read_to_string(dir.0.join(name)).unwrap()
}

fn names(dir: &Dir) -> Vec<String> {
    let entries = std::fs::read_dir(&dir.0).unwrap();
    let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn files_are_formatted_in_place() {
    let dir = Dir::with(UGLY);
    dir.write("pretty.vola", PRETTY);
    let unchanged = || std::fs::metadata(dir.0.join("pretty.vola")).unwrap().modified().unwrap();
    let before = unchanged();
    assert_eq!(dir.run(&["fmt", "main.vola", "pretty.vola"]).ok(), "");
    assert_eq!(text(&dir, "main.vola"), PRETTY);
    assert_eq!(unchanged(), before, "a file that is as it should be is not written");
    assert_eq!(names(&dir), ["main.vola", "pretty.vola"], "nothing is left beside them");
    dir.run(&["fmt"]).fails(2);
}

#[test]
fn the_standard_input_goes_to_the_standard_output() {
    let dir = Dir::new();
    assert_eq!(dir.run_with(&["fmt", "-"], UGLY).ok(), PRETTY);
    dir.run_with(&["fmt", "-"], WRONG).fails_with(1, &["error[E02", "<stdin>:1:"]);
    let checked = dir.run_with(&["fmt", "--check", "-"], UGLY);
    assert_eq!((checked.code, checked.out.as_str(), checked.err.as_str()), (Some(1), "<stdin>\n", ""));
    assert_eq!(dir.run_with(&["fmt", "--check", "-"], PRETTY).ok(), "");
}

#[test]
fn check_lists_what_would_change_and_writes_nothing() {
    let dir = Dir::with(UGLY);
    dir.write("pretty.vola", PRETTY);
    dir.write("bom.vola", &format!("\u{feff}{PRETTY}"));
    let ran = dir.run(&["fmt", "--check", "main.vola", "pretty.vola", "bom.vola"]);
    assert_eq!((ran.code, ran.out.as_str(), ran.err.as_str()), (Some(1), "main.vola\nbom.vola\n", ""));
    assert_eq!(text(&dir, "main.vola"), UGLY);
    assert_eq!(dir.run(&["fmt", "--check", "pretty.vola"]).ok(), "");
}

#[test]
fn what_has_errors_is_left_alone_and_the_rest_is_formatted() {
    let dir = Dir::with(WRONG);
    dir.write("good.vola", UGLY);
    std::fs::write(dir.0.join("bytes.vola"), b"fn f\xFF").unwrap();
    let ran = dir.run(&["fmt", "main.vola", "bytes.vola", "none.vola", "good.vola"]);
    ran.fails_with(1, &["error[E02", "main.vola:1:", "error[E0101]", "cannot read `none.vola`"]);
    assert_eq!((text(&dir, "main.vola").as_str(), text(&dir, "good.vola").as_str()), (WRONG, PRETTY));
    // Names and types do not matter, and neither does what is imported.
    let dir = Dir::with("module self::missing;\nmodule std::none;\nfn f( x:real )->int { y }\n");
    assert_eq!(dir.run(&["fmt", "main.vola"]).ok(), "");
    let expected = "module self::missing;\nmodule std::none;\nfn f(x: real) -> int { y }\n";
    assert_eq!(text(&dir, "main.vola"), expected);
    let nested = Dir::with("fn f(x: real) -> real { ((((x)))) }\n");
    nested.run(&["fmt", "main.vola", "--limit", "nesting=3"]).fails_with(1, &["error[E1004]"]);
}

#[test]
fn migrating_moves_to_the_current_dialect() {
    let dir = Dir::with(OLD);
    dir.write("part.vola", "module ext::k;\nfn part(x: s) -> s { k(x) }\n");
    dir.write("lib/k.vola", "fn k(x: real) -> real { x }\n");
    assert_eq!(dir.run(&["fmt", "--check", "main.vola"]).ok(), "", "the old form is well formatted too");
    dir.run(&["fmt", "--migrate", "main.vola"]).fails_with(1, &["error[E0306]", "ext"]);
    assert_eq!(text(&dir, "main.vola"), OLD);
    let migrate = ["fmt", "--migrate", "--library", "ext=lib"];
    let listed = dir.run(&[&migrate[..], &["--check", "main.vola"]].concat());
    assert_eq!((listed.code, listed.out.as_str(), listed.err.as_str()), (Some(1), "main.vola\n", ""));
    assert_eq!(dir.run(&[&migrate[..], &["main.vola", "part.vola"]].concat()).ok(), "");
    assert_eq!(text(&dir, "main.vola"), NEW);
    assert_eq!(text(&dir, "part.vola"), "module ext::k;\nfn part(x: real) -> real { k(x) }\n");
    assert_eq!(dir.run_with(&[&migrate[..], &["-"]].concat(), OLD).ok(), NEW);
    // What is wrong with types is an error here, and only errors are told.
    let dir = Dir::with("export f(x: s) { x; x + y }\n");
    let ran = dir.run(&["fmt", "--migrate", "main.vola"]);
    ran.fails_with(1, &["error[E0301]"]);
    assert!(!ran.err.contains("warning"), "{}", ran.err);
}

#[cfg(unix)]
#[test]
fn links_and_permissions_stay() {
    use std::os::unix::fs::PermissionsExt;
    let dir = Dir::new();
    dir.write("real/main.vola", UGLY);
    let (file, link) = (dir.0.join("real/main.vola"), dir.0.join("link.vola"));
    std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o640)).unwrap();
    std::os::unix::fs::symlink("real/main.vola", &link).unwrap();
    assert_eq!(dir.run(&["fmt", "link.vola"]).ok(), "");
    assert_eq!(text(&dir, "real/main.vola"), PRETTY);
    assert!(link.symlink_metadata().unwrap().is_symlink());
    assert_eq!(std::fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o640);
    dir.write("real/main.vola", UGLY);
    std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o440)).unwrap();
    dir.run(&["fmt", "link.vola"]).fails_with(1, &["cannot write `link.vola`", "read-only"]);
    assert_eq!(text(&dir, "real/main.vola"), UGLY);
}
