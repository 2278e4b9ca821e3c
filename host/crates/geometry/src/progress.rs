//! How long computations report their progress; see the crate's documentation.

use std::ops::ControlFlow;

/// The callback of long computations: the stage in plain words, and the fraction of that stage done.
pub type Progress<'a> = &'a mut dyn FnMut(&'static str, f64) -> ControlFlow<()>;

/// Reports the fractions of one stage. They stay within 0 and 1 and never decrease, whatever the underlying estimates
/// do.
pub(crate) fn stage<'a>(progress: Progress<'a>, name: &'static str) -> impl FnMut(f64) -> ControlFlow<()> + 'a {
    let mut most = 0.0_f64;
    move |done| {
        if done > most {
            most = done.min(1.0);
        }
        progress(name, most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fractions_of_a_stage_never_fall() {
        let mut seen = Vec::new();
        let mut record = |name, done| {
            seen.push((name, done));
            if seen.len() < 6 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        let mut report = stage(&mut record, "counting");
        let answers = [-1.0, 0.5, 0.25, f64::NAN, 7.0, 0.0].map(|done| report(done).is_break());
        assert_eq!(answers, [false, false, false, false, false, true]);
        drop(report);
        assert_eq!(seen, [0.0, 0.5, 0.5, 0.5, 1.0, 1.0].map(|done| ("counting", done)));
    }
}
