// A CANopen station made of the unmodified npm package `canopen`, driven over standard input and output.
//
// Each line is one JSON object. From the test: {"frame": [id, hexdata]} is a frame that came over the bus, and
// {"call": [number, name, args]} asks for a service. To the test: {"frame": [id, hexdata]} goes on the bus,
// {"result": [number, value]} or {"error": [number, text, code]} answers a call, and {"event": [name, value]} tells
// what the library has noticed by itself. Nothing of CANopen is done here: every service is the library's own.

const readline = require('node:readline');
const { Device, DataType, LssMode } = require('canopen');

const [, , ownId, otherId] = process.argv.map(Number);

const tell = (message) => process.stdout.write(JSON.stringify(message) + '\n');
const hex = (buffer) => Buffer.from(buffer).toString('hex');

const device = new Device({ id: ownId, enableLss: true });
device.addListener('message', ({ id, data }) => tell({ frame: [id, hex(data)] }));

device.eds.addSdoClientParameter(otherId, 0x600 + otherId, 0x580 + otherId);
device.eds.addHeartbeatConsumer(otherId, 2000);
device.eds.addEmcyConsumer(0x80 + otherId);

const mapped = new Map();

const services = {
    // SDO client. `data` is hexadecimal in both directions.
    upload: async ({ index, subIndex, block }) => hex(await device.sdo.upload({
        deviceId: otherId, index, subIndex, timeout: 5000, blockTransfer: block })),
    download: async ({ index, subIndex, data, block }) => device.sdo.download({
        deviceId: otherId, index, subIndex, data: Buffer.from(data, 'hex'), timeout: 5000, blockTransfer: block }),

    // NMT master.
    nmt: async ({ command, node }) => device.nmt[command](node),

    // LSS master.
    lssFastscan: async (args) => device.lss.fastscan(args),
    lssSelective: async (args) => device.lss.switchModeSelective(args),
    lssNodeId: async ({ node }) => device.lss.configureNodeId(node, 2000),
    lssBitTiming: async ({ table, index }) => device.lss.configureBitTiming(table, index, 2000),
    lssStore: async () => device.lss.storeConfiguration(2000),
    lssInquire: async ({ what }) => device.lss[`inquire${what}`](2000),
    lssOperation: async () => device.lss.switchModeGlobal(LssMode.OPERATION),
    lssConfiguration: async () => device.lss.switchModeGlobal(LssMode.CONFIGURATION),

    // PDOs: objects of its own dictionary, received from or sent to the other node.
    receivePdo: async ({ cobId, objects }) => device.eds.addReceivePdo({ cobId, dataObjects: objects.map(entry) }),
    transmitPdo: async ({ cobId, transmissionType, objects }) => device.eds.addTransmitPdo({
        cobId, transmissionType, dataObjects: objects.map(entry) }),
    setValues: async ({ values }) => { for (const [index, value] of values) mapped.get(index).value = value; },

    // SYNC producer.
    sync: async ({ period_us }) => {
        device.eds.setSyncCobId(0x80);
        device.eds.setSyncCyclePeriod(period_us);
        device.eds.setSyncGenerationEnable(period_us > 0);
    },

    // SDO server and heartbeat producer, for the roles the other way round.
    serve: async ({ client, heartbeat_ms, identity, objects }) => {
        device.eds.setIdentity(identity);
        device.eds.addSdoServerParameter(client, 0x580 + ownId, 0x600 + ownId);
        device.eds.setHeartbeatProducerTime(heartbeat_ms);
        device.eds.setEmcyCobId(0x80 + ownId);
        objects.map(entry);
    },
    value: async ({ index }) => mapped.get(index).value,
    emergency: async ({ code }) => device.emcy.write(code),

    start: async () => {
        device.start();
        device.nmt.on('heartbeat', (value) => tell({ event: ['heartbeat', [value.deviceId, value.state]] }));
        device.nmt.on('timeout', (value) => tell({ event: ['timeout', value] }));
        device.emcy.on('emergency', ({ em }) => tell({ event: ['emergency', [em.code, em.register, hex(em.info)]] }));
        device.pdo.on('pdo', ({ cobId, dataObjects }) => tell({ event: ['pdo', [
            cobId, Object.fromEntries(dataObjects.map((object) => [object.index, object.value]))]] }));
        device.nmt.startNode();
    },
};

function entry({ index, type, value }) {
    if (!mapped.has(index))
        mapped.set(index, device.eds.addEntry(index, {
            parameterName: `Object ${index.toString(16)}`, dataType: DataType[type], defaultValue: value ?? 0 }));
    return mapped.get(index);
}

readline.createInterface({ input: process.stdin }).on('line', (line) => {
    const message = JSON.parse(line);
    if (message.frame) {
        device.receive({ id: message.frame[0], data: Buffer.from(message.frame[1], 'hex') });
        return;
    }
    const [number, name, args] = message.call;
    Promise.resolve()
        .then(() => services[name](args))
        .then((value) => tell({ result: [number, value ?? null] }))
        .catch((error) => tell({ error: [number, String(error), error.code ?? null] }));
}).on('close', () => process.exit(0));
tell({ event: ['ready', process.version] });
