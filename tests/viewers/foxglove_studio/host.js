// A page with Foxglove Studio, as its web application makes it: without an account, with one layout, kept in memory.
const data = await (await fetch("/layout.json")).json();
const layouts = new Map();
const settings = new Map([["launchPreference", "web"], ["telemetry.telemetryEnabled", false], ["telemetry.crashReportingEnabled", false],
  ["colorScheme", "light"], ["timezone", "UTC"]]);
const storage = {
  list: async () => [...layouts.values()],
  get: async (_, id) => layouts.get(id),
  put: async (_, layout) => (layouts.set(layout.id, layout), layout),
  delete: async (_, id) => void layouts.delete(id),
  importLayouts: async () => {},
};
layouts.set("gridweave", {
  id: "gridweave", name: "gridweave", permission: "CREATOR_WRITE", baseline: { data, savedAt: undefined }, working: undefined, syncInfo: undefined,
});
const configuration = {
  get: (key) => settings.get(key),
  set: async (key, value) => void settings.set(key, value),
  addChangeListener: () => {},
  removeChangeListener: () => {},
};
await window.initI18n();
ReactDOM.render(React.createElement(window.App, {
  deepLinks: [location.href],
  appConfiguration: configuration,
  dataSources: [new window.RemoteDataSourceFactory()],
  layoutStorage: storage,
  extensionLoaders: [],
  enableGlobalCss: true,
}), document.getElementById("root"));
