//! Files that are damaged at random, from seeds: every reader ends with a value or an error, every command with an exit
//! code of the table, and none of them takes long.
//!
//! The short form runs with all other tests. The long form (9,600 commands, a hundred times as many files in memory):
//!
//! ```text
//! ARMATURE_MUTATIONS=9600 cargo test -p armature --test mutation -- --nocapture
//! ```
//!
//! `ARMATURE_MUTATION_SEED` starts elsewhere, or repeats what failed: a failure prints its seed, says what was done to
//! which file, and keeps that file.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

mod commands;
#[path = "../../host/tests/common/mod.rs"]
mod common;
mod damage;
mod readers;
mod samples;
mod seal;

use std::sync::Arc;

use common::Place;
use damage::damaged;
use samples::Sample;

/// Commands of the short form.
const SHORT: u64 = 48;
/// Files read in memory for each command.
const READS_A_COMMAND: u64 = 100;

fn number(variable: &str, default: u64) -> u64 {
    match std::env::var(variable) {
        Ok(text) => text.parse().unwrap_or_else(|_| panic!("{variable} has to be a number, not {text:?}")),
        Err(_) => default,
    }
}

/// Which seeds to try: `count` of them.
fn seeds(count: u64) -> std::ops::Range<u64> {
    let first = number("ARMATURE_MUTATION_SEED", 0);
    first..first + count
}

#[test]
fn readers_survive_damaged_files() {
    let place = Place::new("mutation-readers");
    let (samples, companions) = samples::all(&place);
    let samples: Vec<Sample> = samples.into_iter().filter(|sample| !sample.is_wire()).collect();
    let companions = Arc::new(companions);
    for sample in &samples {
        readers::read(&sample.name, &sample.bytes, &companions)
            .unwrap_or_else(|error| panic!("{}: {error}", sample.name));
    }
    let mut errors = 0;
    let count = number("ARMATURE_MUTATIONS", SHORT) * READS_A_COMMAND;
    for seed in seeds(count) {
        let file = damaged(&samples, seed);
        errors += usize::from(readers::read_in_time(&place, seed, &file, &companions).is_err());
    }
    println!("{count} damaged files were read: {errors} gave an error, the others a value");
    // If no reader notices the damage, there is none.
    assert!(errors as u64 * 10 > count, "only {errors} of {count} damaged files gave an error");
}

#[test]
fn commands_survive_damaged_files() {
    let place = Place::new("mutation-commands");
    let (samples, _) = samples::all(&place);
    let count = number("ARMATURE_MUTATIONS", SHORT);
    let mut ended = std::collections::BTreeMap::<i32, u64>::new();
    for seed in seeds(count) {
        let file = damaged(&samples, seed);
        *ended.entry(commands::run(&place, seed, &file)).or_default() += 1;
    }
    println!("{count} commands by exit code: {ended:?}");
    assert!(ended.len() > 1, "all commands ended the same way: {ended:?}");
}
