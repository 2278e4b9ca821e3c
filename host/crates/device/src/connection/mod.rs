//! A session that runs over a line on a tokio runtime: [`Connection::open`], [`Connection::next`], [`Connection::close`].

mod owner;
mod pump;
mod talk;
mod whereabouts;

pub use owner::{Connection, ConnectionSettings};
