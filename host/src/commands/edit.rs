//! `armature edit`

use std::path::Path;

use armature_take::{Edit, EditList};

use crate::characters::ground::GroundArgs;
use crate::cli::edit_args::{EditAction, EditArgs};
use crate::failure::Failure;
use crate::files::{self, Overwrite};
use crate::takes::edits;
use crate::terminal::{Bar, Talk, aside, counted, out};

/// Changes an edit list, or shows what it makes of its take. A list that cannot be applied is not saved.
pub fn edit(args: &EditArgs, talk: Talk) -> Result<(), Failure> {
    let path = args.list.as_path();
    if !edits::is_list(path) {
        let what = format!("{} is no name of an edit list", path.display());
        return Err(Failure::usage(what, "give one that ends in .edit, such as walk.edit"));
    }
    let (list, overwrite) = match &args.action {
        Some(EditAction::New { take, overwrite }) => {
            overwrite.check(path)?;
            (EditList::new(take), *overwrite)
        }
        _ => (edits::read(path)?, Overwrite { force: true }),
    };
    let changed = changed(&list, args.action.as_ref(), path)?;
    let bar = Bar::new(talk, "editing");
    let applied = edits::apply(path, &changed, args.character.as_deref(), &GroundArgs::default(), &mut bar.stages())?;
    bar.finish();
    if args.action.is_some() {
        overwrite.write(path, changed.write().as_bytes())?;
    }
    if talk.quiet {
        return Ok(());
    }
    let edited = &applied.edited;
    out!(
        "{}: {:?} after {}: {:.3} s, {}",
        path.display(),
        changed.take,
        counted(changed.edits.len(), "edit", "edits"),
        edited.seconds(),
        counted(edited.timeline().len(), "pose", "poses")
    );
    for (index, edit) in changed.edits.iter().enumerate() {
        out!("  {}. {}", index + 1, in_words(edit));
    }
    edited.segments.iter().for_each(|(name, from, to)| out!("  segment {name:?}: {from:.3} s to {to:.3} s"));
    edited.markers.iter().for_each(|(at, text)| out!("  marker at {at:.3} s: {text}"));
    edited.notes.iter().for_each(|note| aside!("note: {note}"));
    Ok(())
}

/// The list after an action.
fn changed(list: &EditList, action: Option<&EditAction>, path: &Path) -> Result<EditList, Failure> {
    let mut list = list.clone();
    match action {
        Some(EditAction::Undo { number }) => {
            let number = number.unwrap_or(list.edits.len().max(1));
            if number == 0 || number > list.edits.len() {
                let what = format!("{} has no edit {number}", files::name_of(path));
                return Err(Failure::usage(what, format!("it has {}", counted(list.edits.len(), "edit", "edits"))));
            }
            list.edits.remove(number - 1);
        }
        Some(action) => list.add(action.edit()),
        None => {}
    }
    Ok(list)
}

/// An edit on one line, as the file has it.
fn in_words(edit: &Edit) -> String {
    let mut list = EditList::new("");
    list.add([edit.clone()]);
    let text = list.write();
    let fields = text.lines().skip_while(|line| *line != "[[edit]]").skip(1).map(str::trim);
    fields.filter(|line| !line.is_empty()).collect::<Vec<_>>().join(", ").replacen("do = ", "", 1).replace('"', "")
}
