/* A client of the npm package ads-client: moves an axis of `hil emulate --ads` and prints what it has seen, as JSON.

     node ads_client.js NODE_MODULES HOST PORT NET_ID
*/
"use strict";

const [, , modules, host, port, net] = process.argv;
const { Client } = require(`${modules}/ads-client`);

const client = new Client({
  targetAmsNetId: net,
  targetAdsPort: 851,
  localAmsNetId: "10.78.1.1.1.1",
  localAdsPort: 32000,
  routerAddress: host,
  routerTcpPort: Number(port),
  hideConsoleWarnings: true,
});

async function until(name, wanted) {
  for (let tries = 0; tries < 200; tries += 1) {
    const { value } = await client.readValue(name);
    if (wanted(value)) return value;
    await new Promise((resolve) => setTimeout(resolve, 20));
  }
  throw new Error(`${name} did not come`);
}

async function codeOf(action) {
  try {
    await action();
  } catch (error) {
    return error.adsError.errorCode;
  }
  return 0;
}

async function main() {
  await client.connect();
  const seen = { info: await client.readDeviceInfo() };
  seen.unknown = await codeOf(() => client.readValue("GVL.axis1.Nothing"));
  seen.types = Object.keys(await client.getDataTypes());
  seen.symbols = Object.keys(await client.getSymbols()).length;
  seen.before = (await client.readValue("GVL.axis1.NcToPlc")).value;
  for (const name of ["Enable", "Enable_Positive", "Enable_Negative"]) {
    await client.writeValue(`MAIN.axis1_Power.${name}`, true);
  }
  await until("MAIN.axis1_Power.Status", (value) => value);
  seen.changes = [];
  const subscription = await client.subscribeValue("GVL.axis1.NcToPlc.ActPos", (data) => seen.changes.push(data.value), 20);
  await client.writeValue("MAIN.axis1_MoveAbsolute.Position", 20);
  await client.writeValue("MAIN.axis1_MoveAbsolute.Velocity", 200);
  await client.writeValue("MAIN.axis1_MoveAbsolute.Execute", true);
  await until("MAIN.axis1_MoveAbsolute.Done", (value) => value);
  await subscription.unsubscribe();
  seen.after = (await client.readValue("GVL.axis1.NcToPlc")).value;
  const raw = await client.readRawMulti([
    { indexGroup: 0x4040, indexOffset: 0, size: 4 },
    { indexGroup: 0x9999, indexOffset: 0, size: 4 },
  ]);
  seen.sum = raw.map((one) => one.errorCode ?? 0);
  const packet = (await client.readValue("GVL.axis1.PlcToNc")).value;
  seen.written = await codeOf(() => client.writeValue("GVL.axis1.PlcToNc", { ...packet, ExtSetPos: 7.5 }));
  seen.packet = (await client.readValue("GVL.axis1.PlcToNc.ExtSetPos")).value;
  seen.refused = await codeOf(() => client.writeValue("GVL.axis1.NcToPlc.ActPos", 1));
  await client.disconnect();
  process.stdout.write(`${JSON.stringify(seen)}\n`);
}

main().then(
  () => process.exit(0),
  (error) => {
    process.stderr.write(`${error.stack}\n${JSON.stringify(error.adsError ?? {})}\n`);
    process.exit(1);
  },
);
