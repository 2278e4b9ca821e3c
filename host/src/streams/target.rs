//! Where a stream goes: `vmc`, `json:54321`, `ws:0.0.0.0:8080`.

use std::fmt;
use std::str::FromStr;

/// What a stream says, and how it travels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StreamKind {
    /// Virtual Motion Capture Protocol: OSC bundles in UDP datagrams, humanoids only.
    Vmc,
    /// One JSON object in each UDP datagram.
    Json,
    /// The same JSON objects as messages of a WebSocket that this program serves.
    WebSocket,
}

impl StreamKind {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Vmc, Self::Json, Self::WebSocket];

    /// Its word in a target.
    pub fn word(self) -> &'static str {
        match self {
            Self::Vmc => "vmc",
            Self::Json => "json",
            Self::WebSocket => "ws",
        }
    }

    /// The port where none is given. For VMC the one at which receivers listen by convention.
    pub fn default_port(self) -> u16 {
        match self {
            Self::Vmc => 39539,
            Self::Json => 54321,
            Self::WebSocket => 54322,
        }
    }
}

/// The host where none is given: this machine, which nobody else can reach.
const LOOPBACK: &str = "127.0.0.1";

/// Where a stream goes; for a WebSocket, where it is served.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StreamTarget {
    /// What is sent.
    pub kind: StreamKind,
    /// A host's name or address, IPv6 without brackets.
    pub host: String,
    /// 1 to 65,535; 0 lets a WebSocket choose.
    pub port: u16,
}

impl fmt::Display for StreamTarget {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let word = self.kind.word();
        if self.host.contains(':') {
            write!(f, "{word}:[{}]:{}", self.host, self.port)
        } else {
            write!(f, "{word}:{}:{}", self.host, self.port)
        }
    }
}

impl FromStr for StreamTarget {
    type Err = String;

    /// `KIND`, `KIND:PORT`, `KIND:HOST` or `KIND:HOST:PORT`; an IPv6 host in brackets.
    fn from_str(text: &str) -> Result<Self, String> {
        let (word, rest) = text.split_once(':').unwrap_or((text, ""));
        let Some(kind) = StreamKind::ALL.into_iter().find(|kind| kind.word() == word) else {
            let words = StreamKind::ALL.map(StreamKind::word).join(", ");
            return Err(format!("a stream is one of {words}, with a host and a port after colons"));
        };
        let (host, port) = match rest.strip_prefix('[') {
            Some(rest) => {
                let (host, after) = rest.split_once(']').ok_or("the bracket around the host is not closed")?;
                (host, after.strip_prefix(':').unwrap_or(after))
            }
            None => match rest.rsplit_once(':') {
                Some(parts) => parts,
                None if rest.bytes().all(|byte| byte.is_ascii_digit()) => ("", rest),
                None => (rest, ""),
            },
        };
        let port = if port.is_empty() {
            kind.default_port()
        } else {
            let parsed = port.parse().ok().filter(|&port| port > 0 || kind == StreamKind::WebSocket);
            parsed.ok_or_else(|| format!("{port} is no port: give a number from 1 to 65535"))?
        };
        let host = if host.is_empty() { LOOPBACK } else { host };
        Ok(Self { kind, host: host.to_owned(), port })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_are_written_in_short_and_at_length() {
        let parse = |text: &str| text.parse::<StreamTarget>().map(|target| target.to_string());
        for (short, whole) in [
            ("vmc", "vmc:127.0.0.1:39539"),
            ("json:9000", "json:127.0.0.1:9000"),
            ("json:studio", "json:studio:54321"),
            ("ws:0.0.0.0:8080", "ws:0.0.0.0:8080"),
            ("vmc:[::1]:39540", "vmc:[::1]:39540"),
            ("vmc:[::1]", "vmc:[::1]:39539"),
        ] {
            assert_eq!(parse(short).as_deref(), Ok(whole), "{short}");
            assert_eq!(parse(whole).as_deref(), Ok(whole), "{whole}");
        }
        for bad in ["", "osc", "vmc:0", "json:70000", "json:host:port", "vmc:[::1", "ws:1:2:x"] {
            assert!(parse(bad).is_err(), "{bad}: {:?}", parse(bad));
        }
    }
}
