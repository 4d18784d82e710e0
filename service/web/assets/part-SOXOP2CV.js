function c(t){let[e=0,n=0]=new Uint8Array(t,0,Math.min(2,t.byteLength)),r=e===255&&n===254||e!==0&&n===0?"utf-16le":e===254&&n===255||e===0&&n!==0?"utf-16be":"utf-8";return new TextDecoder(r).decode(t).replace(/\r\n?/g,`
`)}export{c as a};
