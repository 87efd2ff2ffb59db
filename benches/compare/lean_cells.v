// The cells of the default library in its typical corner, written for speed in Icarus Verilog: primitives and plain
// flip-flops with one delay for all inputs. They leave out what the exported cells are exact in (X propagation,
// delays by input pin, ties within an instant), but count the same histograms. They are the peer's best foot.
`timescale 1fs/1fs
module INV(output Z, input A); not #(21013, 18979) g(Z, A); endmodule
module BUF(output Z, input A); buf #(46219, 45403) g(Z, A); endmodule
module NAND2(output Z, input A, B); nand #(27109, 29147) g(Z, A, B); endmodule
module NOR2(output Z, input A, B); nor #(40763, 26053) g(Z, A, B); endmodule
module AND2(output Z, input A, B); and #(43117, 41081) g(Z, A, B); endmodule
module OR2(output Z, input A, B); or #(44059, 47137) g(Z, A, B); endmodule
module XOR2(output Z, input A, B); xor #(58067, 57041) g(Z, A, B); endmodule
module XNOR2(output Z, input A, B); xnor #(59083, 56039) g(Z, A, B); endmodule
module MUX2(output Z, input A, B, S); assign #(45127, 46381) Z = S ? B : A; endmodule
module DFFR(output reg Q, output QN, input D, CK, R);
  assign QN = ~Q;
  always @(posedge CK or posedge R)
    if (R) Q <= #81043 1'b0;
    else Q <= #75311 D;
endmodule
