export const conservatism = () => "";
