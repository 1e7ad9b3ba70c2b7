use super::*;

#[test]
fn few_large_messages_are_read_at_a_time() {
    let (_folder, files) = write(|log| {
        for time in 0..20 {
            log.raw("/image", "p/msg/I", time, &[0; 3 << 20]);
        }
    });
    let everything = Everything::default();
    let end = |port: &OutputPort| OutputEnd {
        topic: port.name.to_owned(),
        sink: Some(Box::new(Port(port.name, everything.clone()))),
    };
    let ends = kind().outputs.iter().map(end).collect();
    let parameters = toml::Table::from_iter([("files".to_owned(), vec![files[0].to_str().unwrap()].into())]);
    let mut source = kind().make(parameters, &Context::default(), ends).unwrap();
    let mut sent = Vec::new();
    while source.advance().unwrap() {
        let read = everything.0.take();
        sent.push(read.iter().filter(|(_, header, _)| header.flags.contains(MessageFlags::DATA)).count());
    }
    assert_eq!(sent, [6, 6, 6]);
    assert_eq!(everything.0.take().len(), 2);
}
