//! `armature puppet …`

use std::time::Duration;

use armature_device::{
    DeviceAddress, DeviceInfo, Event, Part, PartKind, RefusalReason, Session, SessionSettings, Topology, Transport,
    features, open,
};
use firmware_protocol::{Decoder, DeviceMessage, FrameBuffer, HostMessage, message_type};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::time::Instant;

use crate::cli::puppet_args::{LabelArgs, PartsArgs, PuppetCommand};
use crate::engine::sources::address::problem_failure;
use crate::failure::Failure;
use crate::terminal::{aside, counted, out};

/// Opening the port resets many boards; their boot loader is silent for up to two seconds.
const PATIENCE: Duration = Duration::from_secs(8);
const ASK_AGAIN: Duration = Duration::from_millis(500);
const TICK: Duration = Duration::from_millis(20);

/// Lists the parts of a puppet, or writes into one what it is.
pub fn puppet(command: &PuppetCommand) -> Result<(), Failure> {
    let (PuppetCommand::Parts(PartsArgs { device }) | PuppetCommand::Label(LabelArgs { device, .. })) = command;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(|e| Failure::device(format!("no runtime for the device: {e}"), "close other programs"))?;
    runtime.block_on(async {
        let mut talk = Conversation::open(device).await?;
        let (info, tree) = talk.tree().await?;
        match command {
            PuppetCommand::Parts(_) => lines(&info, &tree).iter().for_each(|line| out!("{line}")),
            PuppetCommand::Label(args) => label(&mut talk, args, &info, &tree).await?,
        }
        Ok(())
    })
}

async fn label(talk: &mut Conversation, args: &LabelArgs, info: &DeviceInfo, tree: &Topology) -> Result<(), Failure> {
    if info.features & features::LABEL == 0 {
        let what = format!("the parts of {:?} have no memory to write to", info.name);
        return Err(Failure::device(what, "its firmware defines what they are"));
    }
    let part = chosen(args.part.as_deref(), tree)?;
    let kind = args.kind.part_kind();
    let sensor_count = kind.sensor_count().unwrap_or(0);
    let outlet_count = args.outlets.unwrap_or(if kind == PartKind::Splitter { 5 } else { 1 });
    let message = HostMessage::Label { uid: part.uid, kind, sensor_count, outlet_count, counts_per_turn: args.counts };
    talk.ask_for_label(&message).await?;
    let (_, tree) = talk.tree().await?;
    let written = tree.parts.iter().find(|p| p.uid == part.uid);
    match written {
        Some(part) if part.kind == kind => out!("written: {}", line(part)),
        _ => return Err(Failure::device(format!("part {} does not report what was written", part.uid), "try again")),
    }
    Ok(())
}

/// The part with this number or these last digits, or the only one without a label.
fn chosen<'t>(wanted: Option<&str>, tree: &'t Topology) -> Result<&'t Part, Failure> {
    let fits = |part: &&Part| match wanted {
        Some(digits) => part.uid.to_string().ends_with(&digits.to_lowercase()),
        None => part.kind == UNLABELLED,
    };
    let found: Vec<&Part> = tree.parts.iter().filter(fits).collect();
    match (found.as_slice(), wanted) {
        ([part], _) => Ok(part),
        ([], Some(digits)) => {
            Err(Failure::usage(format!("no part's number ends with {digits}"), "`armature puppet parts` lists them"))
        }
        ([], None) => {
            Err(Failure::usage("every part already has a label", "choose one with --part NUMBER to label it again"))
        }
        (several, _) => {
            let numbers: Vec<String> = several.iter().map(|part| part.uid.to_string()).collect();
            Err(Failure::usage(format!("several parts fit: {}", numbers.join(", ")), "choose one with --part NUMBER"))
        }
    }
}

const UNLABELLED: PartKind = PartKind::Other(0);

fn lines(info: &DeviceInfo, tree: &Topology) -> Vec<String> {
    let head = format!("{:?}: {}", info.name, counted(tree.parts.len(), "part", "parts"));
    std::iter::once(head).chain(tree.parts.iter().map(line)).collect()
}

fn line(part: &Part) -> String {
    let what = match part.kind {
        PartKind::Bend => "bend".to_owned(),
        PartKind::Twist => "twist".to_owned(),
        PartKind::TwistBendTwist => "twist-bend-twist".to_owned(),
        PartKind::Splitter => "splitter".to_owned(),
        UNLABELLED => "no label yet".to_owned(),
        PartKind::Other(code) => format!("kind {code}"),
    };
    let place = part.parent.map_or("root".to_owned(), |parent| format!("outlet {} of part {parent}", part.outlet));
    let sensors = counted(part.sensor_count.into(), "sensor", "sensors");
    let outlets = counted(part.outlet_count.into(), "outlet", "outlets");
    format!("{}  {what}, {place}, {sensors}, {outlets}", part.uid)
}

/// A session, plus the label request, which a session does not send.
struct Conversation {
    line: Box<dyn Transport>,
    session: Session,
    began: Instant,
    info: Option<DeviceInfo>,
    tree: Option<Topology>,
    decoder: Decoder,
    /// The device's answer to a label.
    labelled: Option<Result<(), RefusalReason>>,
}

impl Conversation {
    async fn open(address: &DeviceAddress) -> Result<Self, Failure> {
        if matches!(address, DeviceAddress::Sim { .. } | DeviceAddress::Servos { .. }) {
            let remedy = "choose the port of a real puppet: serial:PATH[@BAUD], usb:…, hid:… or tcp:HOST:PORT";
            return Err(Failure::usage("simulated puppets and arms of servos have no parts to label", remedy));
        }
        Ok(Self {
            line: open(address).await.map_err(|problem| problem_failure(&problem))?,
            session: Session::new(SessionSettings::default()),
            began: Instant::now(),
            info: None,
            tree: None,
            decoder: Decoder::new(),
            labelled: None,
        })
    }

    /// Who the device is, and what is plugged together. Asked for again after a label.
    async fn tree(&mut self) -> Result<(DeviceInfo, Topology), Failure> {
        let asked = Instant::now();
        while asked.elapsed() < PATIENCE {
            self.listen().await?;
            if let (Some(info), Some(tree)) = (&self.info, &self.tree) {
                return Ok((info.clone(), tree.clone()));
            }
        }
        let what = format!("the puppet has not described itself within {} s", PATIENCE.as_secs());
        let remedy = "does it have power, is this the right port, and does the line speed match (serial:PATH@BAUD)?";
        Err(Failure::device(what, remedy))
    }

    async fn ask_for_label(&mut self, message: &HostMessage) -> Result<(), Failure> {
        let mut frame = FrameBuffer::new();
        let bytes = frame.encode(message).map_err(|e| Failure::usage(e.to_string(), ""))?.to_vec();
        let began = Instant::now();
        self.tree = None;
        let mut next = began;
        while began.elapsed() < PATIENCE {
            if Instant::now() >= next {
                self.line.write_all(&bytes).await.map_err(|e| gone(&e))?;
                next = Instant::now() + ASK_AGAIN;
            }
            self.listen().await?;
            match self.labelled {
                Some(Ok(())) => return Ok(()),
                Some(Err(reason)) => return Err(refused(reason)),
                None => {}
            }
        }
        let what = format!("the puppet has not answered the label request within {} s", PATIENCE.as_secs());
        Err(Failure::device(what, "`armature devices --decode` shows what it sends"))
    }

    /// Handles what arrives within one tick.
    async fn listen(&mut self) -> Result<(), Failure> {
        let mut events = Vec::new();
        let mut arrived = vec![0; 4096];
        self.session.tick(self.began.elapsed(), &mut events);
        self.line.write_all(&self.session.take_outgoing()).await.map_err(|e| gone(&e))?;
        if let Ok(read) = tokio::time::timeout(TICK, self.line.read(&mut arrived)).await {
            let length = read.map_err(|e| gone(&e))?;
            if length == 0 {
                return Err(gone(&std::io::ErrorKind::UnexpectedEof.into()));
            }
            self.session.receive(self.began.elapsed(), &arrived[..length], &mut events);
            self.hear_label(&arrived[..length]);
        }
        for event in events {
            match event {
                Event::Connected(info) => self.info = Some(info),
                Event::Topology(tree) => self.tree = Some(tree),
                Event::Problem(problem) => aside!("note: {problem}"),
                Event::Notice(notice) => aside!("note: {notice}"),
                _ => {}
            }
        }
        Ok(())
    }

    fn hear_label(&mut self, mut bytes: &[u8]) {
        while let Some(frame) = self.decoder.next_frame(&mut bytes) {
            match DeviceMessage::parse(frame) {
                Ok(DeviceMessage::Acknowledge(answer)) if answer.request == message_type::LABEL => {
                    self.labelled = Some(Ok(()));
                }
                Ok(DeviceMessage::Refuse(answer)) if answer.request == message_type::LABEL => {
                    self.labelled = Some(Err(answer.reason));
                }
                _ => {}
            }
        }
    }
}

fn gone(error: &std::io::Error) -> Failure {
    Failure::device(format!("the connection was lost: {error}"), "check cable and power")
}

fn refused(reason: RefusalReason) -> Failure {
    match reason {
        RefusalReason::SensorBusFailed => {
            let remedy = "check the memory's solder joints, and that it is not write-protected";
            Failure::device("the part's memory did not store the label", remedy)
        }
        RefusalReason::NoSuchPart => Failure::device("the part is no longer plugged in", "plug it in again"),
        other => {
            Failure::device(format!("the puppet refuses the label: {other:?}"), "check --kind, --outlets and --counts")
        }
    }
}
