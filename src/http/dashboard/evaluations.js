export const view = async () => ({ title: "Evaluations", body: "" });
export const report = view;
